/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is drawn of the last frame set: vertices, and all that the camera has to know, which another
 * instance (camera.cpp, on the page's main thread) takes as it is. */
#include <algorithm>
#include <iterator>
#include <rangecast/surface/view_fit.hpp>
#include <vector>

#include "border.hpp"

using rangecast::SurfaceLayer;

namespace {

struct Scene {
  rangecast::SurfaceScene surfaces;
  rangecast::ViewFit fit;
  unsigned rig_number = 0, frame_set = 0;
  rangecast::SurfaceSettings settings;
  std::vector<double> state;

  Scene () { settings.strips.mode = rangecast::StripMode::kBlend; }
};

Scene &
scene ()
{
  static Scene *made = nullptr;
  if (!made)
    made = new Scene;
  return *made;
}

void
write (std::vector<double> &to, std::initializer_list<double> values)
{
  to.insert (to.end (), values);
}

void
write (std::vector<double> &to, const rangecast::Vec3 &v)
{
  write (to, {v.x, v.y, v.z});
}

/* In the order in which camera.cpp reads it. */
void
write_state (Scene &s, const rangecast::SceneFrame &home)
{
  std::vector<double> &to = s.state;
  to.clear ();
  write (to, {double (s.settings.strips.mode), double (s.surfaces.rig_views ()),
                 double (s.surfaces.layers ().size ()), double (s.surfaces.hull ().size ())});
  for (const rangecast::Vec3 &v : {home.target, home.to_first, home.up})
    write (to, v);
  write (to,
      {home.distance_m, home.elevation_deg, home.fov_deg, home.off_centre_x, home.off_centre_y});
  for (const SurfaceLayer &layer : s.surfaces.layers ()) {
    const rangecast::View &view = *layer.view;
    const rangecast::Roi &roi = layer.image.roi;
    const rangecast::Intrinsics &lens = view.intrinsics;
    write (to, {double (view.id), double (view.width), double (view.height), lens.fx, lens.fy,
                   lens.cx, lens.cy, view.depth_unit_m});
    to.insert (
        to.end (), view.world_from_view.rotation.begin (), view.world_from_view.rotation.end ());
    write (to, view.world_from_view.translation);
    write (to, {double (roi.x), double (roi.y), double (roi.width), double (roi.height)});
  }
  for (const rangecast::Vec3 &v : s.surfaces.hull ())
    write (to, v);
}

} // namespace

/** Makes the vertices of the last frame set, unless it has those that would be made.
 *  @param mode    0: blend, 1: strips
 *  @param fits    1: the camera's default position shows the person; 0: it is the first view's
 *  @param aspect  width / height of the picture; then the orbit, as rc_orbit() gives it
 *  @return kDone, kNothing if there is no frame set, kFailed if a view is too large */
RC_EXPORT (rc_build)
std::int32_t
rc_build (std::int32_t mode, std::int32_t fits, double aspect, double azimuth_deg,
    double elevation_deg, double distance_m, double fov_deg, double pan_x, double pan_y,
    double pan_z, std::uint32_t home_requests)
{
  Scene &s = scene ();
  const web::FrameSet set = web::frame_set ();
  if (set.number == 0 || !web::has_rig ())
    return web::kNothing;
  const rangecast::Orbit orbit = {
      azimuth_deg, elevation_deg, distance_m, fov_deg, {pan_x, pan_y, pan_z}};
  if (s.rig_number != set.rig_number) {
    s.surfaces.set_rig (*set.rig);
    s.fit.reset ();
  }
  const auto strip_mode = mode == 1 ? rangecast::StripMode::kStrips : rangecast::StripMode::kBlend;
  s.settings.serial += s.settings.strips.mode != strip_mode;
  s.settings.strips.mode = strip_mode;
  const bool same = s.rig_number == set.rig_number && s.frame_set == set.number;
  s.surfaces.build (set.images, s.settings, orbit, same);
  s.rig_number = set.rig_number;
  s.frame_set = set.number;
  if (!fits)
    s.fit.reset ();
  write_state (s, fits ? s.fit.update (s.surfaces, {orbit, aspect, set.pts_ns, home_requests})
                       : s.surfaces.frame ());
  return web::kDone;
}

/** Number of layers of the last rc_build(): views that have an image; 0 if a frame set was decoded
 *  since. */
RC_EXPORT (rc_layers) std::uint32_t rc_layers ()
{
  const Scene &s = scene ();
  const web::FrameSet set = web::frame_set ();
  const bool current =
      web::has_rig () && s.rig_number == set.rig_number && s.frame_set == set.number;
  return current ? std::uint32_t (s.surfaces.layers ().size ()) : 0;
}

/** @return a record of a layer: view-id, address and bytes of its vertices (BlendVertex or
 *  StripVertex), width, height, addresses of depth (uint16) and colour (RGBx), and the pixels from
 *  one row to the next of each; nullptr if there is none */
RC_EXPORT (rc_layer) const double *rc_layer (std::uint32_t index)
{
  static double record[9];
  if (index >= rc_layers ())
    return nullptr;
  const SurfaceLayer &layer = scene ().surfaces.layers ()[index];
  const auto address = [] (const void *p) { return double (reinterpret_cast<std::uintptr_t> (p)); };
  const bool blends = scene ().settings.strips.mode == rangecast::StripMode::kBlend;
  const auto &depth = layer.image.depth;
  const auto &colour = layer.image.colour;
  const double values[] = {double (layer.view->id),
      blends ? address (layer.blend_vertices.data ()) : address (layer.vertices.data ()),
      double (blends ? layer.blend_vertices.size_bytes () : layer.vertices.size_bytes ()),
      double (depth.width), double (depth.height), address (depth.data), address (colour.data),
      double (depth.stride) / 2, double (colour.stride) / 4};
  std::copy (std::begin (values), std::end (values), record);
  return record;
}

/** What rc_camera_scene() takes. @return a record: address, bytes */
RC_EXPORT (rc_scene_state) const double *rc_scene_state ()
{
  static double record[2];
  const std::vector<double> &state = scene ().state;
  record[0] = double (reinterpret_cast<std::uintptr_t> (state.data ()));
  record[1] = double (state.size () * sizeof (double));
  return record;
}
