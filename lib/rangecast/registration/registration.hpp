/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>

#include "../geometry/range_image.hpp"
#include "depth_mesh.hpp"

namespace rangecast {

/** The camera whose view a registered range image has. */
enum class RegisterInto { kDepth, kColour };

/** Registers depth and colour of two cameras, of any sizes, into one range image.
 *
 *  Into depth: depth stays as measured and each point gets its colour; points that the colour
 * camera does not see, because they are hidden or outside of its image, become invalid. Into
 * colour: depth is rendered from the view of the colour camera (DepthMesh). Lens distortion of both
 * cameras is removed. */
class Registration {
public:
  /** @param depth, colour  the cameras, with poses. Near, far, unit and, into depth, the view-id
   * are those of `depth` */
  Status set (const View &depth, const View &colour, RegisterInto into);

  /** The view of the range images; its id is that of the camera whose view it has. */
  [[nodiscard]] const View &range_view () const { return range_view_; }

  /** @param depth    of the depth camera's size, 0 = invalid
   *  @param metres   per unit of `depth`
   *  @param colour   of the colour camera's size
   *  @param image    of the whole range view; written in full
   *  @return kBadSize if an image has another size */
  Status process (ImageView<const std::uint16_t> depth, double metres, ImageView<const Rgbx> colour,
      const RangeImage &image);

private:
  void write_depth (const RangeImage &image) const;
  void undistort_colour (ImageView<const Rgbx> colour, const RangeImage &image) const;
  void look_up (ImageView<const Rgbx> colour, const RangeImage &image);
  bool sample (ImageView<const Rgbx> colour, const cv::Vec3f &point, Rgbx &out) const;

  View depth_, colour_, range_view_;
  RegisterInto into_ = RegisterInto::kDepth;
  Pose colour_from_depth_;
  std::array<double, 14> bend_{}; /* distortion of the colour camera, all coefficients */
  DepthMesh mesh_, range_mesh_;   /* range_mesh_: of the range view, where depth had distortion */
  Intrinsics shadow_lens_;        /* of hidden_: no finer than the depth image */
  cv::Mat hidden_, drawn_, maps_[2];
  cv::Mat outside_; /* pixels outside of the distorted colour image; empty: none */
};

} // namespace rangecast
