/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <string>
#include <vector>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"

namespace rangecast {

/** Statistics of one pixel of the empty scene. */
struct BackgroundPixel {
  float mean[3] = {};     ///< R, G, B, 0 .. 255
  float spread = 0;       ///< standard deviation of colour, RMS over R, G, B
  float depth = 0;        ///< mean of the valid depths, depth units; 0 = never valid
  float depth_spread = 0; ///< standard deviation of depth, depth units
  float depth_share = 0;  ///< fraction of frames with valid depth, 0 .. 1
  float nearest = 0;      ///< minimum of the valid depths, depth units; 0 = never valid
};

/** Mean and standard deviation of colour and valid depth of one view's empty scene. Computed by
 *  running sums (B. P. Welford, "Note on a method for calculating corrected sums of
 *  squares and products", Technometrics 4, 1962). Rows and columns are those of the full image, so
 * that range images with any ROI can be compared. */
class BackgroundModel {
public:
  /** Value in adapt()'s mask: the background differs from the model. */
  static constexpr std::uint8_t kDifferent = 1;

  /** Discards what was learnt. @param width, height  of the view's full image, pixels */
  void reset (int width, int height);

  /** Adds an image of the empty scene; updates the pixels in its ROI.
   *  @return kBadSize if the ROI is not inside the full image */
  Status learn (const ConstRangeImage &image);

  [[nodiscard]] int frames () const { return frames_; }
  [[nodiscard]] int width () const { return width_; }
  [[nodiscard]] int height () const { return height_; }
  /** A pixel that was never updated has depth 0 and a negative spread: any colour differs from it.
   */
  [[nodiscard]] const BackgroundPixel *row (int y) const
  {
    return pixels_.data () + static_cast<std::size_t> (y) * static_cast<std::size_t> (width_);
  }

  /** Depth interpolated from the surroundings where depth was rarely or never valid, depth units; 0
   * = too far from known depth, or depth was valid. */
  [[nodiscard]] const float *inferred_depth (int y) const
  {
    return inferred_.data () + static_cast<std::size_t> (y) * static_cast<std::size_t> (width_);
  }

  /** Computes means and standard deviations. */
  void finish ();

  /** Moves pixels that match the model towards the image, with the time constant `adapt_time_s`.
   * Learns those again that have been different for three seconds, in at least five images.
   *  @param image  ignored if its ROI is not inside the full image; its capture time is used
   *  @param teach  of the size of the ROI: see Segmenter::quiet()
   *  @param light  brightness of the image by channel relative to the model, which keeps its own
   *  @param adapt_time_s  > 0 */
  void adapt (const ConstRangeImage &image, ImageView<const std::uint8_t> teach,
      const std::array<float, 3> &light, double adapt_time_s);

  /** Whether the ROI is inside the full image. */
  [[nodiscard]] bool covers (const Roi &roi) const
  {
    return roi.x >= 0 && roi.y >= 0 && roi.width <= width_ - roi.x && roi.height <= height_ - roi.y;
  }

  /** Depth noise: the standard deviation at depth z is about this times z squared (both in depth
   *  units). The median of all pixels; 0 if no depth was valid. */
  [[nodiscard]] double depth_noise () const { return depth_noise_; }

private:
  friend Status save_backgrounds (
      const std::string &, const std::vector<std::pair<int, const BackgroundModel *>> &);
  friend Status load_backgrounds (
      const std::string &, std::vector<std::pair<int, BackgroundModel>> &);

  struct Sums {
    BackgroundPixel pixel; // with means and minimum so far
    float colour_m2 = 0, depth_m2 = 0;
    int colour_n = 0, depth_n = 0;
    std::uint32_t since_ms = 0; // of the first one, or when the pixel last matched

    void add (const float (&rgb)[3], std::uint16_t depth);
    [[nodiscard]] BackgroundPixel result () const;
  };
  Status read (const std::string &path, int frames);
  void measure_noise ();
  void infer_depth ();

  int width_ = 0, height_ = 0, frames_ = 0;
  double depth_noise_ = 0;
  std::vector<BackgroundPixel> pixels_;
  std::vector<Sums> sums_;
  std::vector<float> inferred_;
  std::uint64_t adapt_base_ns_ = UINT64_MAX;
};

/** @name The file form
 *  NAME.yml lists views by id; NAME-<id>.pgm beside it is a 16-bit PGM image of eight planes one
 *  below the other, the fields of BackgroundPixel in order: colour times 257, its spread plus 1
 *  times 255, depth, its spread times 16, its share times 65535, nearest depth. @{ */
Status save_backgrounds (
    const std::string &path, const std::vector<std::pair<int, const BackgroundModel *>> &views);
Status load_backgrounds (
    const std::string &path, std::vector<std::pair<int, BackgroundModel>> &views);
/** @} */

} // namespace rangecast
