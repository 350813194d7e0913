/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What codec_bench measures on: frame sets, from pictures, from a recording, or rendered. */
#pragma once

#include <cstdint>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/scene/scene.hpp>
#include <string>
#include <vector>

namespace bench {

/** Depth and colour, row by row; black where there is no depth. */
struct Picture {
  int width = 0, height = 0;        ///< pixels
  std::vector<std::uint16_t> depth; ///< depth units, 0 = invalid
  std::vector<rangecast::Rgbx> colour;

  Picture () = default;
  Picture (int w, int h);
  /** As what the core takes; the pixels stay here. */
  rangecast::RangeImage image (int view_id, const rangecast::Roi &roi);
};

/** One view of a frame set. */
struct ViewPictures {
  int view_id = 0;
  rangecast::Roi roi; ///< of all pixels with depth
  Picture person;     ///< cut to the ROI
};

using FrameSet = std::vector<ViewPictures>;

struct Input {
  rangecast::Rig rig;
  std::vector<FrameSet> sets; ///< in order of time; none is without pixels
  std::string name;           ///< for the report
};

/** A view of a frame set; its ROI is empty if no pixel has depth. */
ViewPictures make_view (int view_id, Picture whole);
/** Pixels with depth, of all frame sets. */
std::size_t count_points (const Input &input);

/** One --color, --depth and perhaps --mask. */
struct PictureFiles {
  std::string colour, depth, mask; ///< mask: empty = all pixels
};

struct FileSettings {
  std::vector<PictureFiles> pairs;
  bool sequence = false;       ///< pairs are frame sets of one view, not views of one frame set
  double depth_unit_m = 0.001; ///< metres
  double near_m = 0,
         far_m = 0; ///< metres, what lies outside is cleared; 0: as the pictures have it
};

/** @return an error that names the file, for what cannot be read or does not fit together */
rangecast::Status load_pictures (const FileSettings &settings, Input &input);

/** Decodes a byte stream file. Frame sets without pixels are left out.
 *  @param skip  frame sets of the file that do not count; @param frames  at most so many after them
 */
rangecast::Status load_recording (const std::string &path, int skip, int frames, Input &input);

/** The figure or model of avatartestsrc, 15 frame sets a second.
 *  @param depth_noise_mm  standard deviation; without it depth is exact */
rangecast::Status render_input (
    const rangecast::SceneSettings &settings, int frames, double depth_noise_mm, Input &input);

} // namespace bench
