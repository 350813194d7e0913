/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rig.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "size_text.hpp"

namespace rangecast {
namespace {

Status
bad_field (const View &view, const std::string &what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + ": " + what};
}

bool
all_finite (std::span<const double> values)
{
  return std::ranges::all_of (values, [] (double v) { return std::isfinite (v); });
}

bool
is_rotation (const Mat3 &r)
{
  if (!all_finite (r))
    return false;
  const Mat3 product = r * transposed (r);
  for (int i = 0; i < 9; i++)
    if (std::abs (product[i] - kIdentity3[i]) > 1e-5)
      return false;
  const Vec3 a{r[0], r[1], r[2]}, b{r[3], r[4], r[5]}, c{r[6], r[7], r[8]};
  return dot (cross (a, b), c) > 0;
}

Status
check_pose (const View &view, const Pose &pose, const std::string &name)
{
  if (!is_rotation (pose.rotation))
    return bad_field (
        view, name + ".rotation is not a rotation matrix (orthonormal to 1e-5, determinant +1)");
  const Vec3 &t = pose.translation;
  if (!(norm (t) < 1e6))
    return bad_field (view, name + ".translation is not finite and below 1e6 m");
  return {};
}

Status
check_lens (
    const View &view, const Intrinsics &k, const Distortion &distortion, const std::string &name)
{
  const double values[] = {k.fx, k.fy, k.cx, k.cy};
  constexpr double kMinFocal = 1e-3; /* less, and points lie beyond what a float can hold */
  if (!all_finite (values) || !(k.fx >= kMinFocal) || !(k.fy >= kMinFocal) || k.fx > 1e6 ||
      k.fy > 1e6 || std::abs (k.cx) > 1e6 || std::abs (k.cy) > 1e6)
    return bad_field (
        view, name + "intrinsics: fx, fy must be 0.001 to 1e6 and cx, cy within 1e6 pixels");
  static constexpr std::size_t kSizes[] = {0, 4, 5, 8, 12, 14};
  if (std::ranges::find (kSizes, distortion.size ()) == std::end (kSizes))
    return bad_field (view, name + "distortion: must have 0, 4, 5, 8, 12 or 14 coefficients, has " +
                                std::to_string (distortion.size ()));
  if (!all_finite (distortion))
    return bad_field (view, name + "distortion: a coefficient is not finite");
  return {};
}

Status
check_partner (const View &view, const std::optional<PartnerCamera> &partner, const char *name)
{
  if (!partner)
    return {};
  const std::string prefix = std::string (name) + ".";
  if (partner->camera.size () > kMaxViewName)
    return bad_field (view, prefix + "camera is longer than 255 bytes");
  if (Status s = check_lens (view, partner->intrinsics, partner->distortion, prefix); !s.ok ())
    return s;
  if (Status s = check_pose (view, partner->partner_from_left, prefix + "partner_from_left");
      !s.ok ())
    return s;
  if (norm (partner->partner_from_left.translation) < 1e-6)
    return bad_field (view, prefix + "partner_from_left: the baseline is zero");
  return {};
}

Status
check_view (const View &view)
{
  if (view.id < 0 || view.id >= kMaxViews)
    return {StatusCode::kBadValue,
        "view-id " + std::to_string (view.id) + ": must be 0 to " + std::to_string (kMaxViews - 1)};
  if (view.name.size () > kMaxViewName)
    return bad_field (view, "name is longer than 255 bytes");
  if (view.camera.size () > kMaxViewName)
    return bad_field (view, "camera is longer than 255 bytes");
  if (view.width < 1 || view.height < 1 || view.width > kMaxImageSide ||
      view.height > kMaxImageSide)
    return bad_field (view, "image size " + size_text (view.width, view.height) +
                                ": must be 1 to " + std::to_string (kMaxImageSide) + " each");
  if (Status s = check_lens (view, view.intrinsics, view.distortion, ""); !s.ok ())
    return s;
  if (Status s = check_pose (view, view.world_from_view, "world_from_view"); !s.ok ())
    return s;
  if (!(view.depth_unit_m >= 1e-7 && view.depth_unit_m <= 1.0))
    return bad_field (view, "depth_unit: must be 1e-7 to 1 metres");
  if (!(view.near_m > 0) || !(view.far_m > view.near_m) ||
      !(view.far_m / view.depth_unit_m < 65536.0)) {
    char text[160];
    std::snprintf (text, sizeof text,
        "near and far are %g and %g m; must be 0 < near < far < 65536 depth units of %g m",
        view.near_m, view.far_m, view.depth_unit_m);
    return bad_field (view, text);
  }
  if (Status s = check_partner (view, view.right, "right"); !s.ok ())
    return s;
  return check_partner (view, view.third, "third");
}

Status
check_pixels (const Rig &rig)
{
  std::int64_t width = 0, height = 0;
  for (const View &view : rig.views) {
    width = std::max<std::int64_t> (width, view.width);
    height = std::max<std::int64_t> (height, view.height);
  }
  if (static_cast<std::int64_t> (rig.views.size ()) * width * height <= kMaxRigPixels)
    return {};
  return {StatusCode::kBadSize, "a rig has at most " + std::to_string (kMaxRigPixels) +
                                    " pixels (views x widest x tallest), this one " +
                                    std::to_string (rig.views.size ()) + " x " +
                                    std::to_string (width) + " x " + std::to_string (height)};
}

} // namespace

Status
scale_view (View &view, int width, int height)
{
  if (view.width == width && view.height == height)
    return {};
  const double sx = double (width) / view.width, sy = double (height) / view.height;
  if (!(std::abs (sx / sy - 1) <= kShapeTolerance))
    return {StatusCode::kBadSize,
        "view " + std::to_string (view.id) + " is " + size_text (view.width, view.height) +
            ", the images are " + size_text (width, height) +
            "; a calibration can only be scaled to the same aspect ratio"};
  view.width = width;
  view.height = height;
  view.intrinsics = view.intrinsics.scaled (sx, sy);
  for (auto *partner : {&view.right, &view.third})
    if (*partner)
      (*partner)->intrinsics = (*partner)->intrinsics.scaled (sx, sy);
  return {};
}

const View *
Rig::find (int view_id) const
{
  const auto it = std::ranges::find (views, view_id, &View::id);
  return it == views.end () ? nullptr : &*it;
}

std::string
Rig::without_view (int view_id) const
{
  std::string text = "has no view with view-id " + std::to_string (view_id), separator = ", only ";
  for (const View &view : views) {
    text += separator + std::to_string (view.id);
    separator = ", ";
  }
  return text;
}

Status
validate (const Rig &rig)
{
  if (rig.views.size () > kMaxViews)
    return {StatusCode::kBadValue,
        "a rig has at most 64 views, this one " + std::to_string (rig.views.size ())};
  std::uint64_t seen = 0;
  for (const View &view : rig.views) {
    if (Status s = check_view (view); !s.ok ())
      return s;
    if (seen >> view.id & 1)
      return bad_field (view, "view-id is used twice");
    seen |= std::uint64_t{1} << view.id;
  }
  return check_pixels (rig);
}

Status
merge (Rig &into, const Rig &other)
{
  Rig merged = into;
  for (const View &view : other.views) {
    const View *known = merged.find (view.id);
    if (!known)
      merged.views.push_back (view);
    else if (encode_rig ({{*known}}) != encode_rig ({{view}}))
      return bad_field (view, "view-id refers to two different cameras");
  }
  if (Status s = check_pixels (merged); !s.ok ())
    return s;
  std::ranges::sort (merged.views, {}, &View::id);
  into = std::move (merged);
  return {};
}

} // namespace rangecast
