/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>

#include "../geometry/range_image.hpp"
#include "depth_mesh.hpp"

namespace rangecast {

/** Whose view a range image of two cameras is. */
enum class RegisterInto { kDepth, kColour };

/** Depth and colour of two cameras that stand side by side, of any sizes, to one range image.
 *
 *  Into depth: every depth stays as it was measured and gets the colour of its point; points that
 *  the colour camera does not see, because something nearer hides them or they lie outside of its
 *  picture, are invalid. Into colour: the depth is drawn as the colour camera sees it (DepthMesh).
 *  Lens distortion of either camera is taken out: the range view has none. */
class Registration {
public:
  /** @param depth, colour  the cameras; their poses say how they stand. Near, far, unit and, into
   *  depth, the view-id are those of `depth` */
  Status set (const View &depth, const View &colour, RegisterInto into);

  /** The view of the range images; its id is that of the camera whose view it is. */
  [[nodiscard]] const View &range_view () const { return range_view_; }

  /** @param depth    of the depth camera's size, 0 = invalid
   *  @param metres   per unit of it
   *  @param colour   of the colour camera's size
   *  @param image    of the whole range view; written in full
   *  @return kBadSize if a picture has another size */
  Status process (ImageView<const std::uint16_t> depth, double metres, ImageView<const Rgbx> colour,
      const RangeImage &image);

private:
  Status rescale (
      ImageView<const std::uint16_t> depth, double metres, const RangeImage &image) const;
  void write_depth (const RangeImage &image) const;
  void straighten (ImageView<const Rgbx> colour, const RangeImage &image) const;
  void look_up (ImageView<const Rgbx> colour, const RangeImage &image);
  bool sample (ImageView<const Rgbx> colour, const cv::Vec3f &point, Rgbx &out) const;

  View depth_, colour_, range_view_;
  RegisterInto into_ = RegisterInto::kDepth;
  Pose colour_from_depth_;
  std::array<double, 14> bend_{}; /* distortion of the colour camera, all coefficients */
  DepthMesh mesh_, range_mesh_;   /* range_mesh_: of the range view, where depth had distortion */
  Intrinsics shadow_lens_;        /* of hidden_: the colour camera, no finer than depth */
  cv::Mat hidden_, drawn_, maps_[2];
  cv::Mat outside_; /* of the colour view: not in the picture that has distortion; empty: none */
};

} // namespace rangecast
