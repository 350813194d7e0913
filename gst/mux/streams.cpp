/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streams.hpp"

#include <algorithm>
#include <cmath>
#include <rangecast/geometry/rectified_pose.hpp>

using rangecast::Rig;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

void
MuxPad::reset ()
{
  has_caps = coded = chosen = alive = clash_reported = offset_known = shift_known = met =
      told_apart = false;
  other_rig = clash = {};
  seen = since = GST_CLOCK_TIME_NONE;
  said = state = MuxState::kIn;
  received = late = out_of_step = left_out = matched = views = 0;
  last_skew = offset = shift = ahead = 0;
}

std::string
MuxPad::title () const
{
  std::string text = std::string ("pad ") + GST_PAD_NAME (pad);
  if (has_caps)
    text += " (view " + std::to_string (view_id ()) + ")";
  return text;
}

/* ---- which streams go together ---- */

/* The format of most streams that come; of those chosen before if as many have the other one. */
static bool
choose_coded (const std::vector<MuxPad *> &order)
{
  int votes = 0; /* > 0: coded */
  for (const MuxPad *entry : order)
    if (entry->alive)
      votes += entry->coded ? 1 : -1;
  return votes != 0 ? votes > 0 : order.front ()->coded;
}

static Status
clash_of (const MuxPad &entry, const std::vector<MuxPad *> &chosen, const MuxFormat &format)
{
  const std::string name = GST_PAD_NAME (entry.pad);
  for (const MuxPad *other : chosen)
    for (const View &view : entry.info.rig.views)
      if (other->info.rig.find (view.id))
        return {StatusCode::kBadValue, "pads " + std::string (GST_PAD_NAME (other->pad)) + " and " +
                                           name + ": both have view-id " +
                                           std::to_string (view.id) + "; expected each view once"};
  if (entry.coded == format.coded)
    return {};
  const std::string first = chosen.empty () ? "most others" : GST_PAD_NAME (chosen.front ()->pad);
  return {StatusCode::kBadValue,
      "pads " + first + " and " + name + ": expected all raw or all coded streams"};
}

Status
choose_streams (const MuxPads &pads, bool strict, MuxFormat &format)
{
  std::vector<MuxPad *> order, chosen;
  for (const auto &entry : pads) {
    if (strict && !entry->other_rig.ok ())
      return {entry->other_rig.code (), entry->title () + ": " + entry->other_rig.message ()};
    entry->chosen = entry->chosen && entry->other_rig.ok ();
    if (entry->has_caps && entry->other_rig.ok ())
      order.push_back (entry.get ());
  }
  std::ranges::stable_sort (order, {},
      [strict] (const MuxPad *entry) { return strict ? 0 : 2 * !entry->alive + !entry->chosen; });
  format = {};
  if (order.empty ())
    return {};
  format.coded = strict ? order.front ()->coded : choose_coded (order);
  Rig united;
  for (MuxPad *entry : order) {
    entry->clash = clash_of (*entry, chosen, format);
    if (entry->clash.ok ())
      entry->clash = rangecast::merge (united, entry->info.rig);
    entry->chosen = entry->clash.ok ();
    if (entry->chosen)
      chosen.push_back (entry);
    else if (strict)
      return entry->clash;
  }
  if (!chosen.empty ())
    format.info = gstrange::make_info (
        std::move (united), chosen.front ()->info.fps_n, chosen.front ()->info.fps_d);
  return {};
}

/* ---- the rig that was asked for ---- */

/* A calibration that comes by another way (a file read again, rectified by another build) is the
 * same to rounding; one that was made anew differs by more. */
constexpr double kSamePlace_m = 1e-3, kSameDirection = 2e-3, kSameScale = 2e-3;
/* Rectification scales the focal length so that no pixel stays empty: by how much depends on the
 * lenses. */
constexpr double kSameRectifiedScale = 0.5;

static double
farthest (const rangecast::Mat3 &a, const rangecast::Mat3 &b)
{
  double most = 0;
  for (std::size_t i = 0; i < a.size (); i++)
    most = std::max (most, std::abs (a[i] - b[i]));
  return most;
}

static Status
differs (const View &view, const std::string &what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + " is not that of the rig: " +
                                     what + "; expected the camera host to have the same rig"};
}

static Status
check_view (const View &view, View expected)
{
  if (Status s = rangecast::scale_view (expected, view.width, view.height); !s.ok ())
    return differs (view, std::to_string (view.width) + "x" + std::to_string (view.height) +
                              " pixels, expected the shape of " + std::to_string (expected.width) +
                              "x" + std::to_string (expected.height));
  double same_scale = kSameScale;
  if (expected.right) {
    rangecast::Pose left_from_rectified;
    left_from_rectified.rotation =
        rangecast::transposed (rangecast::rectifying_rotation (expected.right->partner_from_left));
    expected.world_from_view = expected.world_from_view * left_from_rectified;
    if (!rangecast::is_rectified (expected))
      same_scale = kSameRectifiedScale;
  }
  const rangecast::Pose &p = view.world_from_view, &q = expected.world_from_view;
  if (const double apart = rangecast::norm (p.translation - q.translation);
      !(apart <= kSamePlace_m))
    return differs (view, "it stands " + std::to_string (apart) + " m away");
  if (!(farthest (p.rotation, q.rotation) <= kSameDirection))
    return differs (view, "its optical axis points elsewhere");
  const double scale = view.intrinsics.fx / expected.intrinsics.fx;
  if (!(std::abs (scale - 1) <= same_scale))
    return differs (view, "its focal length is " + std::to_string (scale) + " times as long");
  return {};
}

Status
check_rig (const Rig &stream, const Rig &expected)
{
  for (const View &view : stream.views) {
    const View *known = expected.find (view.id);
    if (!known)
      return {StatusCode::kBadValue,
          "view " + std::to_string (view.id) + " is none of the rig; expected one of its views"};
    if (Status s = check_view (view, *known); !s.ok ())
      return s;
  }
  return {};
}
