/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Prints the geometry of a rig file: poses, fields of view, stereo baselines and depth resolution.
 * usage: rig-check RIG */
#include <cmath>
#include <cstdio>
#include <rangecast/geometry/rectified_pose.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/stereo/rectification.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/view_tint.hpp>
#include <string>

namespace {

using rangecast::PartnerCamera;
using rangecast::Rig;
using rangecast::Status;
using rangecast::Vec3;
using rangecast::View;

std::string
name_of (const View &view)
{
  const std::string number = "view " + std::to_string (view.id);
  return number + (view.name.empty () || view.name == number ? "" : " " + view.name);
}

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
print_cameras (const Rig &rig, Vec3 target)
{
  std::printf ("%-24s %-7s %-10s %-15s %-24s %s\n", "view", "colour", "size", "field of view",
      "position, metres", "distance of axis and camera from the centre");
  for (std::size_t i = 0; i < rig.views.size (); i++) {
    const View &v = rig.views[i];
    const Vec3 at = v.world_from_view.translation, off = cross (target - at, axis_of (v));
    const auto field = [] (double size, double f) {
      return 2 * degrees (std::atan (size / 2 / f));
    };
    const std::string size = std::to_string (v.width) + "x" + std::to_string (v.height);
    const std::string_view colour = rangecast::view_colour (i).name; /* of striprender tint-views */
    std::printf ("%-24s %-7.*s %-10s %5.1f x %-4.1f deg %7.3f %7.3f %7.3f  %.0f mm, %.2f m\n",
        name_of (v).c_str (), int (colour.size ()), colour.data (), size.c_str (),
        field (v.width, v.intrinsics.fx), field (v.height, v.intrinsics.fy), at.x, at.y, at.z,
        norm (off) * 1000, norm (target - at));
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
          "axes differ", "disparity, far to near", "  depth of a pixel of disparity");
    any = any || view.right || view.third;
    if (view.right)
      print_pair (view, *view.right, "right");
    if (view.third)
      print_pair (view, *view.third, "third");
  }
}

/* Reports views that stereodepth would refuse, and pairs that stand badly. @return the number of
 * the former */
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
    } else if (const std::string text = rangecast::describe_misalignment (view); !text.empty ()) {
      std::fprintf (stderr, "rig-check: warning: %s\n", text.c_str ());
    }
  }
  return problems;
}

/* @return whether stereodepth would take all of it */
bool
check_rig (const char *path)
{
  Rig rig;
  const Status status = rangecast::load_rig (path, rig);
  if (!status.ok () || rig.views.empty ()) {
    std::fprintf (stderr, "rig-check: %s\n",
        status.ok () ? (std::string (path) + ": has no views").c_str ()
                     : status.message ().c_str ());
    return false;
  }
  const Vec3 centre = rangecast::scene_frame (rig).target;
  std::printf ("views: %zu; centre (where the optical axes meet): %.3f %.3f %.3f m\n\n",
      rig.views.size (), centre.x, centre.y, centre.z);
  print_cameras (rig, centre);
  print_pairs (rig);
  std::fflush (stdout);
  return print_problems (rig) == 0;
}

} // namespace

int
main (int argc, char **argv)
{
  if (argc != 2 || argv[1][0] == '-') {
    std::fprintf (stderr, "usage: rig-check RIG\n");
    return 2;
  }
  return check_rig (argv[1]) ? 0 : 1;
}
