/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The orbiting camera, the numbers that the shaders take, and pictures drawn without them. */
#include <algorithm>
#include <cstring>
#include <iterator>
#include <optional>
#include <rangecast/render/software_renderer.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/painting.hpp>
#include <rangecast/surface/shaders.hpp>
#include <vector>

#include "border.hpp"

using rangecast::Mat4;
using rangecast::Roi;
using rangecast::SceneFrame;
using rangecast::StripMode;
using rangecast::Vec3;
using rangecast::View;

namespace {

constexpr unsigned kColour = rangecast::kBackgroundColour;
constexpr float kBackground[] = {
    (kColour >> 16) / 255.f, (kColour >> 8 & 255) / 255.f, (kColour & 255) / 255.f, 1};

struct Layer {
  View view;
  Roi roi;
  std::vector<rangecast::SurfaceVertex> vertices; /* see rc_draw_layer() */
};

struct Scene {
  SceneFrame home;
  std::vector<Layer> layers;
  std::vector<Vec3> hull;
};

/* @return false, with nothing changed, if the bytes are not what rc_scene_state() gave */
bool
read_scene (std::span<const std::uint8_t> bytes, Scene &to)
{
  web::SceneState state;
  if (bytes.size () < sizeof state)
    return false;
  std::memcpy (&state, bytes.data (), sizeof state);
  bytes = bytes.subspan (sizeof state);
  const std::uint64_t size = std::uint64_t{state.layers} * sizeof (web::LayerState) +
                             std::uint64_t{state.points} * sizeof (Vec3);
  if (state.layers > rangecast::kMaxDecoderViews || size != bytes.size ())
    return false;
  to.home = state.home;
  to.layers.resize (state.layers);
  for (auto &[view, roi, vertices] : to.layers) {
    web::LayerState layer;
    std::memcpy (&layer, bytes.data (), sizeof layer);
    bytes = bytes.subspan (sizeof layer);
    view.id = layer.id;
    view.width = layer.width;
    view.height = layer.height;
    view.intrinsics = layer.intrinsics;
    view.world_from_view = layer.world_from_view;
    view.depth_unit_m = layer.depth_unit_m;
    roi = layer.roi;
  }
  to.hull.resize (state.points);
  if (!bytes.empty ())
    std::memcpy (to.hull.data (), bytes.data (), bytes.size ());
  return true;
}

struct Camera {
  rangecast::OrbitMotion motion;
  Scene scene;
  std::optional<Mat4> clip_from_world; /* in place of the orbit */
  std::vector<float> picture;
  rangecast::SoftwareRenderer renderer;
  std::vector<rangecast::SurfaceLayer> drawn;
  std::vector<rangecast::Rgbx> pixels;
};

Camera &
camera ()
{
  static Camera &made = *new Camera;
  return made;
}

/* ---- the picture's record ---- */

void
write (std::vector<float> &to, std::initializer_list<double> values)
{
  for (const double value : values)
    to.push_back (static_cast<float> (value));
}

/** An array of floats: background R, G, B, A; the atlas: cells, width, height, 0; the part of the
 *  framebuffer that may be covered (x, y, width, height); depth shift a, b, g; reach; whether it
 *  mirrors; number of layers. For each layer: its place (matrix 16, behind 2), number of its cell,
 *  what leads to it from a pixel of the picture (x, y), lens (4), viewer (3), unit,
 *  cotangent (per_w, offset)
 *  @param max_side  of a texture, pixels */
void
write_picture (std::vector<float> &to, const Scene &scene, StripMode mode,
    const Mat4 &clip_from_world, int width, int height, int max_side)
{
  static rangecast::BlendAtlas atlas;
  static std::vector<double> alignments;
  const Roi covered =
      rangecast::covered_part (clip_from_world, scene.hull, width, height, {0, 0, width, height});
  const auto shift =
      rangecast::depth_shift (clip_from_world, clip_from_world, rangecast::kBlendRange_m);
  alignments.clear ();
  for (const Layer &layer : scene.layers)
    alignments.push_back (rangecast::view_alignment (clip_from_world, layer.view));
  const bool any = !covered.empty () && !alignments.empty ();
  if (any)
    rangecast::make_blend_atlas (alignments,
        mode == StripMode::kBlend ? rangecast::kMaxBlendCells : 1, covered,
        std::max ({max_side, width, height}), atlas);
  to.assign (std::begin (kBackground), std::end (kBackground));
  write (to, {any ? double (atlas.cells) : 0, double (atlas.width), double (atlas.height), 0});
  write (to,
      {double (covered.x), double (covered.y), double (covered.width), double (covered.height)});
  write (to, {shift.a, shift.b, shift.g, double (rangecast::fill_reach (height)),
                 double (rangecast::mirrors (clip_from_world)), double (scene.layers.size ())});
  for (std::size_t i = 0; i < scene.layers.size (); i++) {
    const auto &[view, roi, vertices] = scene.layers[i];
    const rangecast::LayerPlace place =
        rangecast::place_layer (rangecast::clip_from_pixel (clip_from_world, view, roi),
            clip_from_world, rangecast::layer_gap (mode, clip_from_world, view));
    const rangecast::LayerAngles angles = rangecast::layer_angles (clip_from_world, view, roi);
    const std::size_t cell = any ? atlas.cell_of[i] : 0;
    to.insert (to.end (), place.clip_from_pixel.begin (), place.clip_from_pixel.end ());
    to.insert (to.end (), std::begin (place.behind), std::end (place.behind));
    write (to, {double (cell), double (atlas.from_picture[cell][0]),
                   double (atlas.from_picture[cell][1])});
    to.insert (to.end (), std::begin (angles.lens), std::end (angles.lens));
    to.insert (to.end (), std::begin (angles.viewer), std::end (angles.viewer));
    const auto cotangent =
        rangecast::view_cotangent (clip_from_world, view, cell, atlas.cells, scene.layers.size ());
    write (to, {angles.unit, cotangent.per_w, cotangent.offset});
  }
}

/* A picture's matrices. Drags count in pixels of the last such picture. */
Mat4
look (std::int32_t width, std::int32_t height, bool top_first)
{
  Camera &c = camera ();
  if (c.clip_from_world) {
    Mat4 m = *c.clip_from_world;
    for (int i = 1; top_first && i < 16; i += 4)
      m[i] = -m[i];
    return m;
  }
  const double room_m = std::max (2 * rangecast::kViewGap_m, rangecast::kBlendRange_m);
  const auto matrices = rangecast::orbit_matrices (
      c.scene.home, c.motion.orbit, double (width) / height, top_first, {}, c.scene.hull, room_m);
  c.motion.set_shown (matrices, c.scene.home, width, height);
  return matrices.clip_from_world;
}

} // namespace

/** Takes what rc_scene_state() of any instance gave, from the input. @return RangecastResult */
RC_EXPORT (rc_camera_scene) std::int32_t rc_camera_scene (std::uint32_t size)
{
  if (!read_scene (web::input (size), camera ().scene))
    return web::decoder ().fail ("The scene's state is damaged.");
  return RANGECAST_OK;
}

/** Later pictures are of this matrix: the input, 16 floats, column-major, OpenGL's coordinates.
 *  @param size  bytes; 0: of the orbit again */
RC_EXPORT (rc_set_clip) void rc_set_clip (std::uint32_t size)
{
  Camera &c = camera ();
  c.clip_from_world.reset ();
  if (size == sizeof (Mat4) && web::input (size).size () == size)
    std::memcpy (&c.clip_from_world.emplace (), web::input (size).data (), size);
}

/** The camera's numbers for a picture of the scene, in OpenGL's coordinates (first row at the
 *  bottom).
 *  @param max_side  of a texture, pixels; @param strips  1: views are not blended
 *  @return as write_picture() */
RC_EXPORT (rc_camera_picture)
const float *
rc_camera_picture (
    std::int32_t width, std::int32_t height, std::int32_t max_side, std::int32_t strips)
{
  Camera &c = camera ();
  write_picture (c.picture, c.scene, strips ? StripMode::kStrips : StripMode::kBlend,
      look (width, height, false), width, height, max_side);
  return c.picture.data ();
}

/** @return where the vertices of a layer of the scene are to be written for rc_draw(); nullptr if
 *  there is no such layer or it has none */
RC_EXPORT (rc_draw_layer) void *rc_draw_layer (std::uint32_t index, std::uint32_t bytes)
{
  Camera &c = camera ();
  if (index >= c.scene.layers.size ())
    return nullptr;
  c.scene.layers[index].vertices.resize (bytes / sizeof (rangecast::SurfaceVertex));
  return c.scene.layers[index].vertices.data ();
}

/** Draws the scene as striprender does in software in mode blend.
 *  @param transparent  1: without background; @param strips  1: the nearest surface, not blended
 *  @return R, G, B, A of the pixels, rows from the top */
RC_EXPORT (rc_draw)
const rangecast::Rgbx *
rc_draw (std::int32_t width, std::int32_t height, std::int32_t transparent, std::int32_t strips)
{
  Camera &c = camera ();
  rangecast::SurfacePicture picture = {.clip_from_world = look (width, height, true),
      .mode = strips ? StripMode::kStrips : StripMode::kBlend,
      .back_faces = true,
      .width = width,
      .height = height,
      .part = {0, 0, width, height}};
  picture.covered =
      rangecast::covered_part (picture.clip_from_world, c.scene.hull, width, height, picture.part);
  for (int i = 0; i < 4; i++)
    picture.background[i] = transparent ? 0 : kBackground[i];
  c.drawn.clear ();
  for (const Layer &layer : c.scene.layers)
    c.drawn.push_back ({{layer.view.id, layer.roi, {}, {}}, &layer.view, layer.vertices});
  c.pixels.resize (std::size_t (width) * std::size_t (height));
  c.renderer.draw (picture, c.drawn,
      {c.pixels.data (), width, height, std::ptrdiff_t (sizeof (rangecast::Rgbx)) * width});
  return c.pixels.data ();
}

/** @return a record: azimuth, elevation (degrees), distance (metres, 0: default), field of view
 *  (degrees, 0: default), pan x, y, z (metres), number of times the default was asked for */
RC_EXPORT (rc_orbit) const double *rc_orbit ()
{
  static double record[8];
  const rangecast::Orbit &o = camera ().motion.orbit;
  const double values[] = {o.azimuth_deg, o.elevation_deg, o.distance_m, o.fov_deg, o.pan.x,
      o.pan.y, o.pan.z, double (camera ().motion.home_requests)};
  std::copy (std::begin (values), std::end (values), record);
  return record;
}

RC_EXPORT (rc_set_orbit)
void
rc_set_orbit (double azimuth_deg, double elevation_deg, double distance_m, double fov_deg,
    double pan_x, double pan_y, double pan_z)
{
  camera ().motion.orbit = {azimuth_deg, elevation_deg, distance_m, fov_deg, {pan_x, pan_y, pan_z}};
}

/* What OrbitMotion does. */
RC_EXPORT (rc_orbit_by) void rc_orbit_by (double dx, double dy)
{
  camera ().motion.orbit_by (dx, dy);
}
RC_EXPORT (rc_pan_by) void rc_pan_by (double dx, double dy)
{
  camera ().motion.pan_by (dx, dy);
}
RC_EXPORT (rc_pinch) void rc_pinch (double dx, double dy, double before, double after)
{
  camera ().motion.pinch (dx, dy, before, after);
}
RC_EXPORT (rc_step) void rc_step (std::int32_t right, std::int32_t up)
{
  camera ().motion.step (right, up);
}
RC_EXPORT (rc_step_nearer) void rc_step_nearer (std::int32_t nearer)
{
  camera ().motion.step_nearer (nearer != 0);
}
RC_EXPORT (rc_go_home) void rc_go_home ()
{
  camera ().motion.go_home ();
}

/** The source of a shader (rangecast::Shader) with WebGL2's line of the version; nullptr if there
 *  is none. */
RC_EXPORT (rc_shader) const char *rc_shader (std::uint32_t number)
{
  static std::string source;
  if (number >= rangecast::kShaders)
    return nullptr;
  source = "#version 300 es\n" + rangecast::shader_source (static_cast<rangecast::Shader> (number));
  return source.c_str ();
}
