/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stereosettings.hpp"

#include <iterator>
#include <rangecast/geometry/range_image.hpp>

#include "common/propertyrows.hpp"

using rangecast::MatchAlgorithm;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;
using Settings = StereoDepthSettings;

static constexpr auto kFlags =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
static constexpr rangecast::StereoSettings kDefaults;
static constexpr double kDefaultNear = 0.3, kDefaultFar = 3.0;

/* ---- properties ---- */

static const NumberRow<Settings, double> kReals[] = {
    {"focal-length", "Focal length",
        "Focal length of rectified input in pixels, without a rig (0 = unset)", 0, 1e6, 0,
        [] (Settings &s) -> double & { return s.focal_length; }},
    {"baseline", "Baseline",
        "Distance of the left and right cameras in metres, without a rig (0 = unset)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.baseline; }},
    {"principal-x", "Principal point x",
        "Horizontal principal point of the left camera in pixels, without a rig (-1 = centre)", -1,
        1e6, -1, [] (Settings &s) -> double & { return s.principal_x; }},
    {"principal-y", "Principal point y",
        "Vertical principal point of both cameras in pixels, without a rig (-1 = centre)", -1, 1e6,
        -1, [] (Settings &s) -> double & { return s.principal_y; }},
    {"principal-offset", "Principal point offset",
        "Horizontal principal point of the right camera minus that of the left in pixels, without "
        "a rig (Middlebury's doffs)",
        -1e5, 1e5, 0, [] (Settings &s) -> double & { return s.principal_offset; }},
    {"near", "Near", "Minimum depth to match in metres (0 = from the rig, or 0.3)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.near; }},
    {"far", "Far", "Maximum depth to output in metres (0 = from the rig, or 3)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.far; }},
    {"depth-unit", "Depth unit",
        "Metres per depth unit of the output (0 = from the rig, or 0.0001, larger if far requires "
        "it)",
        0, 1, 0, [] (Settings &s) -> double & { return s.depth_unit; }},
    {"flying-pixel-step", "Flying pixel step",
        "Clear points that fewer than 4 of their 8 neighbours support within this fraction of "
        "their depth (0 = off)",
        0, 1, kDefaults.flying_pixel_step,
        [] (Settings &s) -> double & { return s.core.flying_pixel_step; }},
    {"patch-tolerance", "Patch tolerance",
        "Clear points around which the two images differ by more than this fraction of the local "
        "contrast (0 = off)",
        0, 10, kDefaults.patch_tolerance,
        [] (Settings &s) -> double & { return s.core.patch_tolerance; }},
    {"search-far", "Maximum search depth",
        "Match out to this depth in metres so that background is not mistaken for foreground; "
        "results beyond far are discarded (0 = to infinity)",
        0, 1e4, kDefaults.search_far_m,
        [] (Settings &s) -> double & { return s.core.search_far_m; }},
    {"steady", "Temporal smoothing",
        "Temporal smoothing of depth where nothing moves (0 = off, 1 = strongest)", 0, 1,
        kDefaults.steady, [] (Settings &s) -> double & { return s.core.steady; }},
};
static const NumberRow<Settings, int> kIntegers[] = {
    {"view-id", "View ID", "View of the rig, and view-id of the output", 0,
        rangecast::kMaxViews - 1, 0, [] (Settings &s) -> int & { return s.view_id; }},
    {"block-size", "Block size",
        "Width of the matching block in pixels, odd (0 = 15 for bm, 3 for sgbm and sgbm-3way; "
        "ignored by sgm)",
        0, 51, kDefaults.match.block_size,
        [] (Settings &s) -> int & { return s.core.match.block_size; }},
    {"uniqueness-ratio", "Uniqueness ratio",
        "Margin in percent by which the best match must be better than the second best", 0, 100,
        kDefaults.match.uniqueness_ratio,
        [] (Settings &s) -> int & { return s.core.match.uniqueness_ratio; }},
    {"speckle-window-size", "Speckle window size",
        "Minimum size in pixels of a region of similar disparity; smaller regions are cleared (0 = "
        "off)",
        0, 100000, kDefaults.match.speckle_window_size,
        [] (Settings &s) -> int & { return s.core.match.speckle_window_size; }},
    {"speckle-range", "Speckle range",
        "Maximum disparity difference within a region in pixels, for speckle-window-size", 0, 1000,
        kDefaults.match.speckle_range,
        [] (Settings &s) -> int & { return s.core.match.speckle_range; }},
    {"left-right-max-difference", "Left-right check",
        "Maximum difference in pixels between left-to-right and right-to-left disparities (-1 = no "
        "check)",
        -1, 1000, kDefaults.match.left_right_max_difference,
        [] (Settings &s) -> int & { return s.core.match.left_right_max_difference; }},
    {"silhouette-radius", "Silhouette radius",
        "Radius in pixels around depth edges in which points with the colour of the surface behind "
        "are cleared (0 = off)",
        0, 64, kDefaults.silhouette_radius,
        [] (Settings &s) -> int & { return s.core.silhouette_radius; }},
    {"gap-width", "Gap width",
        "Maximum width in pixels of gaps within one surface that are filled (0 = off)", 0, 1000,
        kDefaults.gap_width, [] (Settings &s) -> int & { return s.core.gap_width; }},
    {"refine", "Refinement iterations", "Disparity refinement iterations (0 = off)", 0, 20,
        kDefaults.refine, [] (Settings &s) -> int & { return s.core.refine; }},
    {"average", "Temporal averaging",
        "Maximum number of frames averaged before matching where nothing moves (1 = off)", 1, 64,
        kDefaults.average, [] (Settings &s) -> int & { return s.core.average; }},
    {"refresh-interval", "Refresh interval",
        "Interval in frames between full images when downstream requests only a region (0 = always "
        "match full images)",
        0, 100000, Settings::kDefaultRefreshInterval,
        [] (Settings &s) -> int & { return s.refresh_interval; }},
    {"n-threads", "Threads", "Number of matching threads (0 = one per CPU core)", 0, 64,
        kDefaults.n_threads, [] (Settings &s) -> int & { return s.core.n_threads; }},
};

enum : guint {
  PROP_REALS = 1,
  PROP_INTEGERS = PROP_REALS + std::size (kReals),
  PROP_RIG = PROP_INTEGERS + std::size (kIntegers),
  PROP_ALGORITHM,
  PROP_QOS
};

GType
gst_stereo_depth_algorithm_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (MatchAlgorithm::kBm), "OpenCV block matching", "bm"},
        {int (MatchAlgorithm::kSgbm), "OpenCV semi-global block matching, five directions", "sgbm"},
        {int (MatchAlgorithm::kSgbm3Way), "OpenCV semi-global block matching, three directions",
            "sgbm-3way"},
        {int (MatchAlgorithm::kSgm), "Semi-global matching of census-like descriptors", "sgm"}, {}};
    return g_enum_register_static ("GstStereoDepthAlgorithm", values);
  }();
  return type;
}

guint
install_stereo_settings (GObjectClass *object_class)
{
  install_rows (object_class, kReals, PROP_REALS, kFlags);
  install_rows (object_class, kIntegers, PROP_INTEGERS, kFlags);
  g_object_class_install_property (object_class, PROP_RIG,
      g_param_spec_string ("rig", "Rig",
          "Rig file with the stereo pair view-id (unset = focal-length and baseline)", nullptr,
          kFlags));
  g_object_class_install_property (object_class, PROP_ALGORITHM,
      g_param_spec_enum ("algorithm", "Algorithm", "Stereo matching algorithm",
          GST_TYPE_STEREO_DEPTH_ALGORITHM, int (kDefaults.match.algorithm), kFlags));
  g_object_class_install_property (object_class, PROP_QOS,
      g_param_spec_boolean ("qos", "QoS",
          "Skip image pairs whose depth would arrive too late downstream", true,
          GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  return PROP_QOS;
}

bool
set_stereo_setting (Settings &settings, guint id, const GValue *value)
{
  if (const auto real = find_row (kReals, id, PROP_REALS))
    real->field (settings) = g_value_get_double (value);
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    integer->field (settings) = g_value_get_int (value);
  else if (id == PROP_RIG)
    settings.rig = g_value_get_string (value) ? g_value_get_string (value) : "";
  else if (id == PROP_ALGORITHM)
    settings.core.match.algorithm = MatchAlgorithm (g_value_get_enum (value));
  else if (id == PROP_QOS)
    settings.qos = g_value_get_boolean (value);
  else
    return false;
  return true;
}

bool
get_stereo_setting (const Settings &settings, guint id, GValue *value)
{
  Settings copy = settings; /* fields are found in what may be written */
  if (const auto real = find_row (kReals, id, PROP_REALS))
    g_value_set_double (value, real->field (copy));
  else if (const auto integer = find_row (kIntegers, id, PROP_INTEGERS))
    g_value_set_int (value, integer->field (copy));
  else if (id == PROP_RIG)
    g_value_set_string (value, settings.rig.empty () ? nullptr : settings.rig.c_str ());
  else if (id == PROP_ALGORITHM)
    g_value_set_enum (value, int (settings.core.match.algorithm));
  else if (id == PROP_QOS)
    g_value_set_boolean (value, settings.qos);
  else
    return false;
  return true;
}

/* ---- the view ---- */

static Status
view_from_rig (const Settings &p, int width, int height, View &view)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (p.rig, rig); !s.ok ())
    return s;
  const View *found = rig.find (p.view_id);
  if (!found)
    return {
        StatusCode::kNotFound, p.rig + ": has no view with view-id " + std::to_string (p.view_id)};
  view = *found;
  const Status scaled = rangecast::scale_view (view, width, height);
  return scaled.ok () ? scaled : Status{scaled.code (), p.rig + ": " + scaled.message ()};
}

static Status
view_from_properties (const Settings &p, int width, int height, View &view)
{
  if (p.focal_length <= 0 || p.baseline <= 0)
    return {StatusCode::kNotFound,
        "no calibration: expected property rig, or focal-length and baseline for rectified "
        "pictures"};
  view = {};
  view.id = p.view_id;
  view.width = width;
  view.height = height;
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1}; /* level, looking along -z */
  view.near_m = kDefaultNear;
  view.far_m = kDefaultFar;
  view.intrinsics = {p.focal_length, p.focal_length,
      p.principal_x >= 0 ? p.principal_x : (width - 1) / 2.0,
      p.principal_y >= 0 ? p.principal_y : (height - 1) / 2.0};
  rangecast::PartnerCamera right;
  right.intrinsics = view.intrinsics;
  right.intrinsics.cx += p.principal_offset;
  right.partner_from_left.translation.x = -p.baseline;
  view.right = right;
  return {};
}

Status
make_stereo_view (const Settings &p, int width, int height, View &view)
{
  Status status = p.rig.empty () ? view_from_properties (p, width, height, view)
                                 : view_from_rig (p, width, height, view);
  if (!status.ok ())
    return status;
  if (p.depth_unit > 0)
    view.depth_unit_m = p.depth_unit;
  if (p.near > 0)
    view.near_m = p.near;
  if (p.far > 0)
    view.far_m = p.far;
  if (view.far_m >= 65535 * view.depth_unit_m && p.depth_unit <= 0)
    view.depth_unit_m = view.far_m / 65000; /* far scenes get a coarser unit by themselves */
  return rangecast::validate ({{view}});
}
