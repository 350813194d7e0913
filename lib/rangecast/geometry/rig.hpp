/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "../base/status.hpp"
#include "camera.hpp"
#include "range_image.hpp"

namespace rangecast {

/** A camera that stands beside the view's own (left) camera: same image size. */
struct PartnerCamera {
  Intrinsics intrinsics;
  Distortion distortion;
  Pose partner_from_left;  ///< X_partner = R * X_left + t, as cv::stereoCalibrate returns R, T
  std::string camera = {}; ///< as View::camera
};

/** One view of a rig. A raw view may have lens distortion and partners (right, third); a *range
 *  view*, what the caps of range images carry, is a plain pinhole camera without either. */
struct View {
  int id = 0;                 ///< 0 .. kMaxViews - 1, unique in the rig
  std::string name;           ///< at most kMaxViewName bytes of UTF-8; for display only
  std::string camera;         ///< serial number, name or address of the (left) camera, for programs
                              ///< that open it; at most kMaxViewName bytes; in the file form only
  int width = 0;              ///< pixels, full image
  int height = 0;             ///< pixels, full image
  Intrinsics intrinsics;      ///< of the left camera, or of the range image
  Distortion distortion;      ///< of the left camera; empty for a range view
  Pose world_from_view;       ///< of the left camera; world: right-handed, y up, metres
  double depth_unit_m = 1e-4; ///< metres per depth step
  double near_m = 0.3;        ///< nearest depth of interest, metres, > 0
  double far_m = 3.0;         ///< farthest depth of interest, metres, > near_m, < 65536 units
  std::optional<PartnerCamera> right;
  std::optional<PartnerCamera> third;

  [[nodiscard]] bool is_range_view () const { return distortion.empty () && !right && !third; }
};

inline constexpr std::size_t kMaxViewName = 255;

/** How far the scales of width and height may differ: image sizes are whole numbers, 854x480 is the
 *  shape of 1280x720. */
inline constexpr double kShapeTolerance = 0.005;

/** The same cameras at another image size: the intrinsics of the view and of its partners scaled.
 *  Distortion, poses, near and far stay as they are.
 *  @return kBadSize if the shape differs by more than kShapeTolerance; the view is then untouched
 */
Status scale_view (View &view, int width, int height);

/** All views with their calibration. */
struct Rig {
  std::vector<View> views; ///< 0 .. kMaxViews of them, in any order, ids unique

  /** The view with this id, or nullptr. */
  [[nodiscard]] const View *find (int view_id) const;
  /** "has no view with view-id 7, only 0, 1", for errors. */
  [[nodiscard]] std::string without_view (int view_id) const;
};

/** Checks every field against the ranges above; the message names view and field.
 *  @return kBadSize if the rig is larger than kMaxRigPixels, else kBadValue */
Status validate (const Rig &rig);

/** Union of two rigs. A view that both have must be the same in both.
 *  @return kBadValue if a view-id stands for two different cameras, kBadSize if the union is larger
 *  than kMaxRigPixels (`into` is then untouched). */
Status merge (Rig &into, const Rig &other);

/** @name The binary form
 *  Versioned, little-endian, for caps, byte streams and SDP; layout in docs/formats/rig.md. @{ */
std::vector<std::uint8_t> encode_rig (const Rig &rig);
/** Decodes and validates. Trailing bytes are an error: a blob's length is always known.
 *  @return kBadSize if the rig is larger than kMaxRigPixels, else kBadData or kTruncated */
Status decode_rig (std::span<const std::uint8_t> blob, Rig &rig);
/** @} */

} // namespace rangecast
