/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Says what a rig file amounts to: where its cameras stand and look, what they see, and how well
 * they tell depths apart; and draws it (striprender's show-cameras). */
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <clocale>
#include <cmath>
#include <cstdio>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeinfo.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/stereo/rectification.hpp>
#include <rangecast/surface/camera_lines.hpp>
#include <rangecast/surface/orbit.hpp>
#include <string>
#include <vector>

namespace {

using rangecast::PartnerCamera;
using rangecast::Rig;
using rangecast::Status;
using rangecast::Vec3;
using rangecast::View;

struct Options {
  gchar *png = nullptr;
  gint width = 960, height = 720;
  gdouble azimuth_deg = 30, elevation_deg = 35, distance_m = 0;
  gchar **paths = nullptr;
};

/* One camera of the rig as something to draw, and what it is called. */
struct Camera {
  std::string name;
  View view; /* plain, with an id of its own */
};

/* ---- what there is ---- */

std::string
name_of (const View &view)
{
  const std::string number = "view " + std::to_string (view.id);
  return number + (view.name.empty () || view.name == number ? "" : " " + view.name);
}

View
plain_view (View view, int id)
{
  view.id = id;
  view.distortion.clear ();
  view.right.reset ();
  view.third.reset ();
  return view;
}

/* Partners are drawn small: their view's frustum says what the pair sees. */
void
add_partner (const View &view, const std::optional<PartnerCamera> &partner, const char *which,
    std::vector<Camera> &cameras)
{
  if (!partner || cameras.size () >= rangecast::kMaxViews)
    return;
  View drawn = plain_view (view, int (cameras.size ()));
  drawn.intrinsics = partner->intrinsics;
  drawn.world_from_view = view.world_from_view * partner->partner_from_left.inverse ();
  drawn.far_m = 0.25 * view.near_m;
  drawn.near_m = 0.2 * view.near_m;
  cameras.push_back ({name_of (view) + " " + which, drawn});
}

std::vector<Camera>
cameras_of (const Rig &rig)
{
  std::vector<Camera> cameras;
  for (const View &view : rig.views)
    cameras.push_back (
        {name_of (view) + (view.right ? " left" : ""), plain_view (view, int (cameras.size ()))});
  for (const View &view : rig.views) {
    add_partner (view, view.right, "right", cameras);
    add_partner (view, view.third, "third", cameras);
  }
  return cameras;
}

/* ---- tables ---- */

double
degrees (double radians)
{
  return radians * 180 / M_PI;
}

double
angle_deg (Vec3 a, Vec3 b)
{
  return degrees (std::acos (std::clamp (dot (a, b) / (norm (a) * norm (b)), -1.0, 1.0)));
}

Vec3
axis_of (const View &view)
{
  return view.world_from_view.rotation * Vec3{0, 0, 1};
}

void
print_cameras (const std::vector<Camera> &cameras, Vec3 target)
{
  std::printf ("%-24s %-7s %-10s %-15s %-24s %s\n", "camera", "colour", "size", "field of view",
      "stands at, metres", "axis passes the centre at");
  for (std::size_t i = 0; i < cameras.size (); i++) {
    const View &v = cameras[i].view;
    const Vec3 at = v.world_from_view.translation, off = cross (target - at, axis_of (v));
    const auto field = [] (double size, double f) {
      return 2 * degrees (std::atan (size / 2 / f));
    };
    const std::string size = std::to_string (v.width) + "x" + std::to_string (v.height);
    std::printf ("%-24s %-7.*s %-10s %5.1f x %-4.1f deg %7.3f %7.3f %7.3f  %.0f mm, %.2f m away\n",
        cameras[i].name.c_str (), int (rangecast::camera_colour (i).name.size ()),
        rangecast::camera_colour (i).name.data (), size.c_str (), field (v.width, v.intrinsics.fx),
        field (v.height, v.intrinsics.fy), at.x, at.y, at.z, norm (off) * 1000, norm (target - at));
  }
}

void
print_pair (const View &view, const PartnerCamera &partner, const char *which)
{
  const Vec3 t = partner.partner_from_left.translation;
  const double baseline = norm (t), fx = view.intrinsics.fx;
  const Vec3 axis = rangecast::transposed (partner.partner_from_left.rotation) * Vec3{0, 0, 1};
  const auto step_mm = [&] (double z) { return z * z / (fx * baseline) * 1000; };
  std::printf (
      "%-24s %-6s %7.4f m %7.2f deg %9.1f to %-6.1f px %9.2f mm at %.2f m %9.2f mm at %.2f m\n",
      name_of (view).c_str (), which, baseline, angle_deg (axis, {0, 0, 1}),
      fx * baseline / view.far_m, fx * baseline / view.near_m, step_mm (view.near_m), view.near_m,
      step_mm (view.far_m), view.far_m);
}

void
print_pairs (const Rig &rig)
{
  bool any = false;
  for (const View &view : rig.views) {
    if (!any && (view.right || view.third))
      std::printf ("\n%-24s %-6s %9s %11s %22s %s\n", "stereo pair", "with", "baseline",
          "axes differ", "disparity, far to near", "  a pixel of disparity is");
    any = any || view.right || view.third;
    if (view.right)
      print_pair (view, *view.right, "right");
    if (view.third)
      print_pair (view, *view.third, "third");
  }
}

void
print_views (const Rig &rig)
{
  if (rig.views.size () < 2)
    return;
  std::printf ("\n%-24s %-24s %11s %s\n", "view", "nearest view", "distance", "axes differ");
  for (const View &view : rig.views) {
    const View *nearest = nullptr;
    const auto distance = [&] (const View &other) {
      return norm (other.world_from_view.translation - view.world_from_view.translation);
    };
    for (const View &other : rig.views)
      if (&other != &view && (!nearest || distance (other) < distance (*nearest)))
        nearest = &other;
    std::printf ("%-24s %-24s %9.3f m %7.1f deg\n", name_of (view).c_str (),
        name_of (*nearest).c_str (), distance (*nearest),
        angle_deg (axis_of (view), axis_of (*nearest)));
  }
}

/* What stereodepth would refuse. @return how many views */
int
print_problems (const Rig &rig)
{
  int problems = 0;
  for (const View &view : rig.views) {
    rangecast::Rectifier rectifier;
    if (!view.right)
      continue;
    if (const Status status = rectifier.set (view); !status.ok ()) {
      std::fprintf (stderr, "rig-check: %s\n", status.message ().c_str ());
      problems++;
    }
  }
  return problems;
}

/* ---- the picture ---- */

const char *const kPicture = "appsrc name=in format=time ! striprender name=view "
                             "show-cameras=true ! capsfilter name=size ! gldownload "
                             "! videoconvert ! pngenc ! filesink name=out";

/* Where the picture is taken from. */
struct Outlook {
  Vec3 pan; /* of striprender */
  double distance_m;
};

constexpr double kFieldDeg = 45;

/* Elements make room for all pixels of a rig, and with partners there may be more than a rig can
 * have. What is drawn does not depend on how many there are. */
View
with_few_pixels (View view)
{
  constexpr int kMax = 1024;
  const int width = std::min (view.width, kMax), height = std::min (view.height, kMax);
  view.intrinsics =
      view.intrinsics.scaled (double (width) / view.width, double (height) / view.height);
  view.width = width;
  view.height = height;
  return view;
}

/* The corners of all frustums, and where they begin. */
std::vector<Vec3>
corners_of (const Rig &drawn)
{
  std::vector<Vec3> points;
  for (const View &view : drawn.views)
    for (double u : {0, view.width})
      for (double v : {0, view.height})
        for (double z : {0.0, view.near_m, view.far_m})
          points.push_back (view.world_from_view * view.intrinsics.unproject (u, v, z));
  return points;
}

/* The part of the picture that the points take, -1 to 1 from left to right and from the bottom up.
 */
struct Frame {
  double left = 1e9, right = -1e9, bottom = 1e9, top = -1e9;
  bool behind = false; /* some of them are behind who looks */

  [[nodiscard]] double half_size () const { return std::max (right - left, top - bottom) / 2; }
};

Frame
frame_of (const std::vector<Vec3> &points, const rangecast::Mat4 &m)
{
  Frame frame;
  for (Vec3 p : points) {
    const auto row = [&] (int r) {
      return m[r] * p.x + m[4 + r] * p.y + m[8 + r] * p.z + m[12 + r];
    };
    const double w = row (3);
    if (w <= 1e-6) {
      frame.behind = true;
      continue;
    }
    frame.left = std::min (frame.left, row (0) / w);
    frame.right = std::max (frame.right, row (0) / w);
    frame.bottom = std::min (frame.bottom, row (1) / w);
    frame.top = std::max (frame.top, row (1) / w);
  }
  return frame;
}

/* All frustums fill the picture. striprender turns about where the axes meet, which for a single
 * pair is nowhere in particular, so what it looks at is moved. Perspective makes this a search:
 * each step centres what is seen and corrects the distance. */
Outlook
look_at_all (const Rig &drawn, const Options &options)
{
  constexpr double kFilled = 0.94;
  const std::vector<Vec3> points = corners_of (drawn);
  const rangecast::SceneFrame scene = rangecast::scene_frame (drawn);
  rangecast::Orbit orbit = {options.azimuth_deg, options.elevation_deg, 1, kFieldDeg, {}};
  for (Vec3 p : points)
    orbit.distance_m = std::max (orbit.distance_m, 3 * norm (p - scene.target));
  for (int step = 0; step < 50; step++) {
    const auto seen =
        rangecast::orbit_matrices (scene, orbit, double (options.width) / options.height, false);
    const Frame frame = frame_of (points, seen.clip_from_world);
    if (frame.behind) {
      orbit.distance_m *= 1.5;
      continue;
    }
    orbit.pan = orbit.pan + (frame.left + frame.right) / 4 * seen.pan_right -
                (frame.bottom + frame.top) / 4 * seen.pan_down;
    orbit.distance_m *= std::clamp (frame.half_size () / kFilled, 0.7, 1.4);
  }
  return {orbit.pan, orbit.distance_m};
}

void
set_up (GstElement *pipeline, const Options &options, const Rig &drawn)
{
  GstElement *view = gst_bin_get_by_name (GST_BIN (pipeline), "view");
  GstElement *size = gst_bin_get_by_name (GST_BIN (pipeline), "size");
  GstElement *out = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstElement *in = gst_bin_get_by_name (GST_BIN (pipeline), "in");
  GstCaps *picture = gst_caps_from_string ("video/x-raw(memory:GLMemory)");
  gst_caps_set_simple (
      picture, "width", G_TYPE_INT, options.width, "height", G_TYPE_INT, options.height, nullptr);
  const Outlook outlook = look_at_all (drawn, options);
  g_object_set (view, "azimuth", options.azimuth_deg, "elevation", options.elevation_deg,
      "distance", options.distance_m > 0 ? options.distance_m : outlook.distance_m, "field-of-view",
      kFieldDeg, "pan-x", outlook.pan.x, "pan-y", outlook.pan.y, "pan-z", outlook.pan.z, nullptr);
  g_object_set (size, "caps", picture, nullptr);
  g_object_set (out, "location", options.png, nullptr);
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (drawn, 1, 1));
  g_object_set (in, "caps", caps, nullptr);
  gst_caps_unref (caps);
  gst_caps_unref (picture);

  /* A frame set of which nothing is left. */
  GstBuffer *empty = gst_range_buffer_new (1, 1, 1);
  gst_range_buffer_add_view (empty, guint (drawn.views[0].id), 0, 0, 0, 0, 0);
  GST_BUFFER_PTS (empty) = 0;
  gst_app_src_push_buffer (GST_APP_SRC (in), empty);
  gst_app_src_end_of_stream (GST_APP_SRC (in));
  for (GstElement *element : {view, size, out, in})
    gst_object_unref (element);
}

bool
draw (const Options &options, const Rig &drawn)
{
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (kPicture, &error);
  if (!pipeline || error) {
    g_printerr ("rig-check: %s\n", error->message);
    g_clear_error (&error);
    gst_clear_object (&pipeline);
    return false;
  }
  set_up (pipeline, options, drawn);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 60 * GST_SECOND, GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_EOS));
  const bool drawn_well = message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS;
  if (message && !drawn_well) {
    gst_message_parse_error (message, &error, nullptr);
    g_printerr ("rig-check: %s\n", error->message);
    g_clear_error (&error);
  } else if (!message) {
    g_printerr ("rig-check: %s: not drawn within a minute\n", options.png);
  }
  gst_clear_message (&message);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return drawn_well;
}

bool
check_rig (const Options &options)
{
  Rig rig;
  const Status status = rangecast::load_rig (options.paths[0], rig);
  if (!status.ok () || rig.views.empty ()) {
    g_printerr ("rig-check: %s\n",
        status.ok () ? (std::string (options.paths[0]) + ": has no views").c_str ()
                     : status.message ().c_str ());
    return false;
  }
  const std::vector<Camera> cameras = cameras_of (rig);
  const rangecast::SceneFrame scene = rangecast::scene_frame (rig);
  Rig drawn;
  for (const Camera &camera : cameras)
    drawn.views.push_back (with_few_pixels (camera.view));
  std::printf ("views: %zu, which look at about %.3f %.3f %.3f m\n\n", rig.views.size (),
      scene.target.x, scene.target.y, scene.target.z);
  print_cameras (cameras, scene.target);
  print_pairs (rig);
  print_views (rig);
  std::fflush (stdout);
  bool good = print_problems (rig) == 0;
  if (options.png)
    good = draw (options, drawn) && good;
  return good;
}

/* What is wrong with the options, or nullptr. Angles and distances are those that striprender
 * takes. */
const char *
complaint_of (const Options &o)
{
  const auto is_within = [] (double x, double min, double max) {
    return x >= min && x <= max; /* NaN is not */
  };
  if (!o.paths || o.paths[1])
    return "expected one rig file";
  if (!is_within (o.width, 1, 8192) || !is_within (o.height, 1, 8192))
    return "--width and --height: expected 1 to 8192 pixels";
  if (!is_within (o.azimuth_deg, -360, 360) || !is_within (o.elevation_deg, -89, 89))
    return "--azimuth and --elevation: expected -360 to 360 and -89 to 89 degrees";
  if (o.png && !g_str_has_suffix (o.png, ".png") && !g_str_has_suffix (o.png, ".PNG"))
    return "--png: expected a file name that ends in .png";
  return is_within (o.distance_m, 0, 1000) ? nullptr : "--distance: expected 0 to 1000 metres";
}

bool
parse_arguments (int *argc, char ***argv, Options &options)
{
  const GOptionEntry entries[] = {
      {"png", 0, 0, G_OPTION_ARG_FILENAME, &options.png, "Draw the rig", "FILE"},
      {"width", 0, 0, G_OPTION_ARG_INT, &options.width, "Of the picture (default 960)", "PX"},
      {"height", 0, 0, G_OPTION_ARG_INT, &options.height, "Of the picture (default 720)", "PX"},
      {"azimuth", 0, 0, G_OPTION_ARG_DOUBLE, &options.azimuth_deg,
          "Round the scene from the first view (default 30)", "DEG"},
      {"elevation", 0, 0, G_OPTION_ARG_DOUBLE, &options.elevation_deg,
          "Above the first view (default 35)", "DEG"},
      {"distance", 0, 0, G_OPTION_ARG_DOUBLE, &options.distance_m,
          "From the middle of the cameras (default: so that all are seen)", "M"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &options.paths, nullptr, nullptr},
      {}};
  GOptionContext *context = g_option_context_new ("RIG - say and draw what a rig file is");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  bool parsed = g_option_context_parse (context, argc, argv, &error);
  if (!parsed) {
    g_printerr ("rig-check: %s\n", error->message);
  } else if (const char *complaint = complaint_of (options)) {
    g_printerr ("rig-check: %s; see --help\n", complaint);
    parsed = false;
  }
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed;
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Options options;
  const int status = parse_arguments (&argc, &argv, options) ? (check_rig (options) ? 0 : 1) : 2;
  g_free (options.png);
  g_strfreev (options.paths);
  return status;
}
