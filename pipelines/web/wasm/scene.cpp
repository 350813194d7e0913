/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is drawn of the last frame set: vertices, and all that the camera has to know, which another
 * instance (camera.cpp, on the page's main thread) takes as it is. */
#include <rangecast/surface/view_fit.hpp>
#include <vector>

#include "border.hpp"

using rangecast::SurfaceLayer;

namespace {

struct Scene {
  rangecast::SurfaceScene surfaces;
  rangecast::ViewFit fit;
  unsigned rig_number = 0;
  std::uint64_t frame_set = 0;
  rangecast::SurfaceSettings settings;
  std::vector<std::uint8_t> state;

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

/* Whether the vertices are those of the last frame set. */
bool
is_current ()
{
  const Scene &s = scene ();
  const RangecastDecoder &decoder = web::decoder ();
  return decoder.rig () && s.rig_number == decoder.rig_number () &&
         s.frame_set == decoder.frame_set ().number;
}

template <typename T>
void
append (std::vector<std::uint8_t> &to, const T &value)
{
  static_assert (std::is_trivially_copyable_v<T>);
  const auto bytes = reinterpret_cast<const std::uint8_t *> (&value);
  to.insert (to.end (), bytes, bytes + sizeof value);
}

/* For camera.cpp. */
void
write_state (Scene &s, const rangecast::SceneFrame &home)
{
  const auto layers = s.surfaces.layers ();
  const auto hull = s.surfaces.hull ();
  s.state.clear ();
  append (s.state, web::SceneState{static_cast<std::uint32_t> (layers.size ()),
                       static_cast<std::uint32_t> (hull.size ()), home});
  for (const SurfaceLayer &layer : layers) {
    const rangecast::View &view = *layer.view;
    append (s.state, web::LayerState{view.id, view.width, view.height, layer.image.roi,
                         view.intrinsics, view.world_from_view, view.depth_unit_m});
  }
  for (const rangecast::Vec3 &point : hull)
    append (s.state, point);
}

} // namespace

/** Makes the vertices of the last frame set, unless it has those that would be made.
 *  @param fits    1: the camera's default position shows the person; 0: it is the first view's
 *  @param aspect  width / height of the picture; then the orbit, as rc_orbit() gives it
 *  @return RANGECAST_OK, or RANGECAST_NOTHING if there is no frame set */
RC_EXPORT (rc_build)
std::int32_t
rc_build (std::int32_t fits, double aspect, double azimuth_deg, double elevation_deg,
    double distance_m, double fov_deg, double pan_x, double pan_y, double pan_z,
    std::uint32_t home_requests)
{
  Scene &s = scene ();
  const RangecastDecoder &decoder = web::decoder ();
  if (!decoder.rig () || decoder.frame_set ().number == 0)
    return RANGECAST_NOTHING;
  const rangecast::Orbit orbit = {
      azimuth_deg, elevation_deg, distance_m, fov_deg, {pan_x, pan_y, pan_z}};
  if (s.rig_number != decoder.rig_number ()) {
    s.surfaces.set_rig (*decoder.rig ());
    s.fit.reset ();
  }
  const bool same = is_current ();
  s.surfaces.build (decoder.images (), s.settings, orbit, same);
  s.rig_number = decoder.rig_number ();
  s.frame_set = decoder.frame_set ().number;
  if (!fits)
    s.fit.reset ();
  const std::uint64_t time = decoder.frame_set ().time; /* kNoPts: unknown */
  write_state (s,
      fits ? s.fit.update (s.surfaces, {orbit, aspect, time, home_requests}) : s.surfaces.frame ());
  return RANGECAST_OK;
}

/** Number of layers of the last rc_build(): views that have an image; 0 if a frame set was decoded
 *  since. */
RC_EXPORT (rc_layers) std::uint32_t rc_layers ()
{
  return is_current () ? std::uint32_t (scene ().surfaces.layers ().size ()) : 0;
}

/** @return a record of a layer: view-id, address and bytes of its vertices (SurfaceVertex); nullptr
 * if there is none */
RC_EXPORT (rc_layer) const double *rc_layer (std::uint32_t index)
{
  static double record[3];
  if (index >= rc_layers ())
    return nullptr;
  const SurfaceLayer &layer = scene ().surfaces.layers ()[index];
  record[0] = double (layer.view->id);
  record[1] = double (reinterpret_cast<std::uintptr_t> (layer.vertices.data ()));
  record[2] = double (layer.vertices.size_bytes ());
  return record;
}

/** What rc_camera_scene() takes. @return a record: address, bytes */
RC_EXPORT (rc_scene_state) const double *rc_scene_state ()
{
  static double record[2];
  const std::vector<std::uint8_t> &state = scene ().state;
  record[0] = double (reinterpret_cast<std::uintptr_t> (state.data ()));
  record[1] = double (state.size ());
  return record;
}
