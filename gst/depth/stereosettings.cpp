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
        "Without a rig, for rectified pictures: pixels (default 0: not set)", 0, 1e6, 0,
        [] (Settings &s) -> double & { return s.focal_length; }},
    {"baseline", "Baseline",
        "Without a rig: distance of the cameras in metres (default 0: not set)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.baseline; }},
    {"principal-x", "Principal point x",
        "Without a rig: of the left camera, pixels (default -1: the centre)", -1, 1e6, -1,
        [] (Settings &s) -> double & { return s.principal_x; }},
    {"principal-y", "Principal point y",
        "Without a rig: of both cameras, pixels (default -1: the centre)", -1, 1e6, -1,
        [] (Settings &s) -> double & { return s.principal_y; }},
    {"principal-offset", "Principal point offset",
        "Without a rig: right minus left principal point x, pixels (Middlebury's doffs, default 0)",
        -1e5, 1e5, 0, [] (Settings &s) -> double & { return s.principal_offset; }},
    {"near", "Near", "Nearest depth to look for, metres (default 0: the rig's, or 0.3)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.near; }},
    {"far", "Far", "Farthest depth to look for, metres (default 0: the rig's, or 3)", 0, 1e4, 0,
        [] (Settings &s) -> double & { return s.far; }},
    {"depth-unit", "Depth unit",
        "Metres per depth unit of the output (0 to 1, default 0: the rig's, or 0.0001, coarser if "
        "far asks for it)",
        0, 1, 0, [] (Settings &s) -> double & { return s.depth_unit; }},
    {"flying-pixel-step", "Flying pixel step",
        "Points that fewer than 4 of 8 neighbours follow within this share of their depth are "
        "cleared (0 = off, to 1, default 0.03)",
        0, 1, kDefaults.flying_pixel_step,
        [] (Settings &s) -> double & { return s.core.flying_pixel_step; }},
    {"patch-tolerance", "Patch tolerance",
        "Points around which both pictures differ by more than this share of the contrast are "
        "cleared "
        "(0 = off, to 10, default 1)",
        0, 10, kDefaults.patch_tolerance,
        [] (Settings &s) -> double & { return s.core.patch_tolerance; }},
    {"search-far", "Search far",
        "What lies beyond far is matched, too, so that it is not taken for something nearer, and "
        "cleared: up to so many metres (default 0: to infinity; as far: nothing is there)",
        0, 1e4, kDefaults.search_far_m,
        [] (Settings &s) -> double & { return s.core.search_far_m; }},
    {"steady", "Steady",
        "Hold depth still where nothing moves: each new depth counts 1 - 0.9 of this (0 = off, to "
        "1, "
        "default 0)",
        0, 1, kDefaults.steady, [] (Settings &s) -> double & { return s.core.steady; }},
};
static const NumberRow<Settings, int> kIntegers[] = {
    {"view-id", "View id", "View of the rig, and view-id of the output (0 to 63, default 0)", 0,
        rangecast::kMaxViews - 1, 0, [] (Settings &s) -> int & { return s.view_id; }},
    {"block-size", "Block size",
        "Width of a block, pixels, odd (0 to 51, default 0: 15 for bm, 3 for sgbm and sgbm-3way; "
        "sgm has none)",
        0, 51, kDefaults.match.block_size,
        [] (Settings &s) -> int & { return s.core.match.block_size; }},
    {"uniqueness-ratio", "Uniqueness ratio",
        "Per cent by which the best match must beat the second (0 to 100, default 0)", 0, 100,
        kDefaults.match.uniqueness_ratio,
        [] (Settings &s) -> int & { return s.core.match.uniqueness_ratio; }},
    {"speckle-window-size", "Speckle window size",
        "Smaller patches of like disparity are cleared, pixels (0 = off, to 100000, default 100)",
        0, 100000, kDefaults.match.speckle_window_size,
        [] (Settings &s) -> int & { return s.core.match.speckle_window_size; }},
    {"speckle-range", "Speckle range",
        "Disparity step within a patch, pixels (0 to 1000, default 2)", 0, 1000,
        kDefaults.match.speckle_range,
        [] (Settings &s) -> int & { return s.core.match.speckle_range; }},
    {"left-right-max-difference", "Left-right difference",
        "Disparities of both directions agree to so many pixels (-1 = no check, to 1000, default "
        "1)",
        -1, 1000, kDefaults.match.left_right_max_difference,
        [] (Settings &s) -> int & { return s.core.match.left_right_max_difference; }},
    {"silhouette-radius", "Silhouette radius",
        "Near a silhouette, points whose colour is that of the other side are cleared: pixels "
        "around "
        "that are looked at (0 = off, to 64, default 8)",
        0, 64, kDefaults.silhouette_radius,
        [] (Settings &s) -> int & { return s.core.silhouette_radius; }},
    {"gap-width", "Gap width",
        "Gaps in a surface of one colour up to so many pixels are filled (0 = off, to 1000, "
        "default "
        "12)",
        0, 1000, kDefaults.gap_width, [] (Settings &s) -> int & { return s.core.gap_width; }},
    {"refine", "Refine",
        "Disparity refinement iterations (0 = off, to 20, "
        "default 2)",
        0, 20, kDefaults.refine, [] (Settings &s) -> int & { return s.core.refine; }},
    {"average", "Average",
        "Frames whose pictures are averaged before matching where nothing moves (1 = off, to 64, "
        "default 10)",
        1, 64, kDefaults.average, [] (Settings &s) -> int & { return s.core.average; }},
    {"refresh-interval", "Refresh interval",
        "When downstream wants only a part, one full picture every so many frames (0: always all, "
        "to "
        "100000, default 30)",
        0, 100000, Settings::kDefaultRefreshInterval,
        [] (Settings &s) -> int & { return s.refresh_interval; }},
    {"n-threads", "Threads", "Threads that match one pair (0, the default: one a core; to 64)", 0,
        64, kDefaults.n_threads, [] (Settings &s) -> int & { return s.core.n_threads; }},
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
    static const GEnumValue values[] = {{int (MatchAlgorithm::kBm), "Block matching", "bm"},
        {int (MatchAlgorithm::kSgbm), "Semi-global matching, five directions", "sgbm"},
        {int (MatchAlgorithm::kSgbm3Way), "Semi-global matching, three directions", "sgbm-3way"},
        {int (MatchAlgorithm::kSgm),
            "Semi-global matching of clipped differences, rows and columns", "sgm"},
        {}};
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
          "Rig file with the stereo pair that view-id names (default: none, see focal-length)",
          nullptr, kFlags));
  g_object_class_install_property (object_class, PROP_ALGORITHM,
      g_param_spec_enum ("algorithm", "Algorithm", "How to match (default: sgm)",
          GST_TYPE_STEREO_DEPTH_ALGORITHM, int (kDefaults.match.algorithm), kFlags));
  g_object_class_install_property (object_class, PROP_QOS,
      g_param_spec_boolean ("qos", "QoS",
          "Do not match pictures whose depth would come too late to be shown (default true)", true,
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
