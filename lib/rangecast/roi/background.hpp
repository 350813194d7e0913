/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <string>
#include <vector>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"

namespace cv {
class FileNode;
}

namespace rangecast {

/** What one pixel of the empty scene looks like. */
struct BackgroundPixel {
  float mean[3] = {};     ///< R, G, B, 0 .. 255
  float spread = 0;       ///< standard deviation of colour, root of the mean over R, G, B
  float depth = 0;        ///< mean of the valid depths, depth units; 0 = never valid
  float depth_spread = 0; ///< standard deviation of depth, depth units
  float depth_share = 0;  ///< share of the frames in which depth was valid, 0 .. 1
  float nearest = 0;      ///< least of the valid depths, depth units; 0 = never valid
};

/** Mean and spread of colour, and of depth where it is valid, of one view's empty scene.
 *  Learnt by running sums (B. P. Welford, "Note on a method for calculating corrected sums of
 *  squares and products", Technometrics 4, 1962). Rows and columns are those of the full image, so
 *  that range images of any ROI can be compared. */
class BackgroundModel {
public:
  /** Forgets everything. @param width, height  of the view's full image, pixels */
  void reset (int width, int height);

  /** Adds one picture of the empty scene; only pixels in its ROI learn.
   *  @return kBadSize if the ROI does not lie in the full image */
  Status learn (const ConstRangeImage &image);

  [[nodiscard]] int frames () const { return frames_; }
  [[nodiscard]] int width () const { return width_; }
  [[nodiscard]] int height () const { return height_; }
  /** A pixel that never learnt has depth 0, and any colour differs from it: spread is negative. */
  [[nodiscard]] const BackgroundPixel *row (int y) const
  {
    return pixels_.data () + static_cast<std::size_t> (y) * static_cast<std::size_t> (width_);
  }

  /** Depth that the background has by what lies around, depth units, where it was never valid or
   *  seldom; 0 = nothing near enough, or it was valid. */
  [[nodiscard]] const float *inferred_depth (int y) const
  {
    return inferred_.data () + static_cast<std::size_t> (y) * static_cast<std::size_t> (width_);
  }

  /** Makes means and spreads of what was learnt. */
  void finish ();

  /** Follows slow change: moves the means of some pixels towards a picture, by the share
   *  1 - exp (-t / adapt_time_s) of the way, t the time since the pixel was taught last (at most
   *  10 s; never more than half of the way). Pixels that the ROI leaves out catch up later.
   *  @param image  its ROI lies in the full image, or nothing is done; capture times count
   *  @param teach  of the ROI: other than 0 where the picture shows the background
   *  @param light  the picture's brightness by channel as a share of the model's, which keeps its
   * own
   *  @param adapt_time_s  > 0 */
  void adapt (const ConstRangeImage &image, ImageView<const std::uint8_t> teach,
      const std::array<float, 3> &light, double adapt_time_s);

  /** Whether the ROI lies in the image. */
  [[nodiscard]] bool covers (const Roi &roi) const
  {
    return roi.x >= 0 && roi.y >= 0 && roi.width <= width_ - roi.x && roi.height <= height_ - roi.y;
  }

  /** How noise of depth grows: its standard deviation at depth z is about this times z squared
   *  (both in depth units). The median of what was learnt; 0 if no depth was valid. */
  [[nodiscard]] double depth_noise () const { return depth_noise_; }

private:
  friend Status save_backgrounds (
      const std::string &, const std::vector<std::pair<int, const BackgroundModel *>> &);
  friend bool read_background (const cv::FileNode &, int &id, BackgroundModel &);

  struct Sums {
    float colour_m2 = 0, depth_m2 = 0;
    int colour_n = 0, depth_n = 0;
  };
  void measure_noise ();
  void infer_depth ();
  static void move_towards (BackgroundPixel &pixel, const Rgbx &colour, std::uint16_t depth,
      const float *to_model, float share);

  int width_ = 0, height_ = 0, frames_ = 0;
  double depth_noise_ = 0;
  std::vector<BackgroundPixel> pixels_;
  std::vector<Sums> sums_;
  std::vector<float> inferred_;
  std::vector<std::uint32_t> taught_ms_; // since adapt_base_ns_, by pixel; empty before adapt()
  std::uint64_t adapt_base_ns_ = 0;
};

/** @name The file form
 *  YAML or JSON (with .gz if wanted) by the file's ending, as cv::FileStorage writes it: for
 *  each view a matrix of width x height x 8 floats, the fields of BackgroundPixel in their order.
 *  A version 1 file had 7 floats and is refused. Messages begin with the path and say what was
 *  expected. @{ */
Status save_backgrounds (
    const std::string &path, const std::vector<std::pair<int, const BackgroundModel *>> &views);
Status load_backgrounds (
    const std::string &path, std::vector<std::pair<int, BackgroundModel>> &views);
/** @} */

} // namespace rangecast
