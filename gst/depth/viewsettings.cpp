/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "viewsettings.hpp"

#include <cmath>
#include <rangecast/geometry/range_image.hpp>
#include <rangecast/rigfile/rig_file.hpp>

using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

Status
load_view (const std::string &rig_file, int view_id, const char *property, int width, int height,
    View &view)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (rig_file, rig); !s.ok ())
    return s;
  const View *found = rig.find (view_id);
  if (!found)
    return {StatusCode::kNotFound,
        rig_file + ": " + rig.without_view (view_id) + "; set property " + property};
  view = *found;
  const Status scaled = rangecast::scale_view (view, width, height);
  return scaled.ok () ? scaled : Status{scaled.code (), rig_file + ": " + scaled.message ()};
}

View
make_pinhole_view (const ViewSettings &settings, double focal_length, int width, int height)
{
  View view;
  view.id = settings.view_id;
  view.width = width;
  view.height = height;
  view.intrinsics = {focal_length, focal_length, (width - 1) / 2.0, (height - 1) / 2.0};
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  return view;
}

void
set_depth_range (const ViewSettings &settings, View &view)
{
  if (settings.near > 0)
    view.near_m = settings.near;
  if (settings.far > 0)
    view.far_m = settings.far;
  if (view.far_m >= 65535 * view.depth_unit_m)
    view.depth_unit_m = view.far_m / 65000; /* make far fit 16 bits */
}

void
check_field_of_view (
    GstElement *element, const ViewSettings &settings, const char *images, int width, int height)
{
  constexpr double kNarrow = 15, kWide = 130; /* degrees */
  if (!settings.rig.empty () || settings.focal_length <= 0)
    return;
  const double degrees = 2 * std::atan (width / 2.0 / settings.focal_length) * 180 / G_PI;
  if (degrees < kNarrow || degrees > kWide)
    GST_ELEMENT_WARNING (element, LIBRARY, SETTINGS,
        ("focal-length=%g gives %s of %dx%d a field of view of %.1f degrees; set it in pixels of "
         "%s at this size",
            settings.focal_length, images, width, height, degrees, images),
        (nullptr));
}

/* ---- stereodepth ---- */

static const GEnumValue kPackings[] = {
    {int (Packing::kAuto), "As multiview-mode in the caps of pad left", "auto"},
    {int (Packing::kNone), "One view at each pad", "none"},
    {int (Packing::kSideBySide), "Left view in the left half", "side-by-side"},
    {int (Packing::kTopBottom), "Left view in the upper half", "top-bottom"}, {}};

PropertyTable<StereoDepthSettings> &
stereo_properties ()
{
  using S = StereoDepthSettings;
  using V = ViewSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::number<&S::view, &V::focal_length> ("focal-length", "Focal length",
          "Focal length of rectified input in pixels, without a rig (0 = unset)", 0, 1e6,
          kMutableReady),
      P::number<&S::baseline> ("baseline", "Baseline",
          "Distance of the left and right cameras in metres, without a rig (0 = unset)", 0, 1e4,
          kMutableReady),
      P::number<&S::view, &V::near> ("near", "Near",
          "Minimum depth to match in metres (0 = from the rig, or 0.3)", 0, 1e4, kMutableReady),
      P::number<&S::view, &V::far> ("far", "Far",
          "Maximum depth to output in metres (0 = from the rig, or 3)", 0, 1e4, kMutableReady),
      P::number<&S::view, &V::view_id> ("view-id", "View ID",
          "View of the rig, and view-id of the output", 0, rangecast::kMaxViews - 1, kMutableReady),
      P::number<&S::refresh_interval> ("refresh-interval", "Refresh interval",
          "Interval in frames between full images when downstream requests only a region (0 = "
          "always match full images)",
          0, 100000, kMutableReady),
      P::number<&S::n_threads> ("n-threads", "Threads",
          "Number of matching threads (0 = one per CPU core)", 0, 64, kMutableReady),
      P::text<&S::view, &V::rig> ("rig", "Rig",
          "Rig file with the stereo pair view-id (unset = focal-length and baseline)",
          kMutableReady),
      P::enumeration<&S::packing> ("packing", "Packing",
          "Whether images at pad left contain both views; pad right is then not linked",
          "GstStereoDepthPacking", kPackings, kMutableReady),
      P::boolean<&S::qos> ("qos", "QoS",
          "Skip image pairs whose depth would arrive too late downstream", kMutablePlaying),
  };
  return table;
}

namespace {

/* A focal length in millimetres, or in image widths, is a common mistake. */
Status
check_disparity (const StereoDepthSettings &settings)
{
  const ViewSettings &v = settings.view;
  const double near = v.near > 0 ? v.near : View{}.near_m;
  const double disparity = v.focal_length * settings.baseline / near;
  if (disparity >= 1)
    return {};
  char text[200];
  g_snprintf (text, sizeof text,
      "focal-length=%g and baseline=%g give a disparity of %.2g pixels at %g m; set "
      "focal-length in pixels (of the order of the width) and baseline in metres",
      v.focal_length, settings.baseline, disparity, near);
  return {StatusCode::kBadValue, text};
}

} // namespace

Status
make_stereo_view (const StereoDepthSettings &settings, int width, int height, View &view)
{
  const ViewSettings &v = settings.view;
  if (!v.rig.empty ()) {
    if (Status s = load_view (v.rig, v.view_id, "view-id", width, height, view); !s.ok ())
      return s;
  } else if (v.focal_length <= 0 || settings.baseline <= 0) {
    return {StatusCode::kNotFound, "no calibration; set property rig, or for rectified images "
                                   "focal-length (pixels) and baseline "
                                   "(metres)"};
  } else if (Status s = check_disparity (settings); !s.ok ()) {
    return s;
  } else {
    view = make_pinhole_view (v, v.focal_length, width, height);
    view.right.emplace ();
    view.right->intrinsics = view.intrinsics;
    view.right->partner_from_left.translation.x = -settings.baseline;
  }
  set_depth_range (v, view);
  return rangecast::validate ({{view}});
}
