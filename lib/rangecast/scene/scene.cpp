/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "../base/parallel.hpp"
#include "mesh.hpp"
#include "model.hpp"
#include "pattern.hpp"
#include "rasteriser.hpp"
#include "room.hpp"

namespace rangecast {

namespace {

constexpr double kWallRadius = 2.2; ///< metres: at least 1.4 from every camera of a ring up to 0.8
constexpr int kCamerasPerView = 3;
constexpr double kNeckHeight = -0.06; ///< the head turns and nods about this point of the y axis

/** Gaussian samples, read from positions given by a hash of camera, time and row. */
class NoiseTable {
public:
  void fill (double sigma, std::uint32_t seed)
  {
    sigma_ = sigma;
    seed_ = seed;
    if (sigma <= 0)
      return;
    samples_.resize (kSamples);
    for (std::size_t i = 0; i < kSamples; i++) {
      /* Box and Muller, from two numbers of 32 bits. */
      const std::uint64_t h = mix64 (i + (std::uint64_t (seed) << 32) + 0x9e3779b97f4a7c15ULL);
      const double a = (double (h >> 32) + 1) / 4294967297.0, b = double (h & 0xffffffff);
      const double g = std::sqrt (-2 * std::log (a)) * std::cos (2 * M_PI * b / 4294967296.0);
      samples_[i] = static_cast<std::int16_t> (std::lround (sigma * g));
    }
  }

  void add (ImageView<Rgbx> picture, int camera, double time_s) const
  {
    if (sigma_ <= 0)
      return;
    const auto frame = static_cast<std::uint64_t> (std::llround (time_s * 1e6));
    const std::uint64_t key = mix64 (frame ^ (std::uint64_t (camera) << 56) ^ seed_);
    const int bytes = 4 * picture.width;
    for (int y = 0; y < picture.height; y++) {
      const auto at =
          mix64 (key + static_cast<std::uint64_t> (y)) % (kSamples - 4 * std::size_t (kMaxSide));
      const std::int16_t *noise = samples_.data () + at;
      auto *pixel = reinterpret_cast<std::uint8_t *> (picture.row (y));
      for (int i = 0; i < bytes; i++)
        pixel[i] = static_cast<std::uint8_t> (std::clamp (pixel[i] + noise[i], 0, 255));
    }
  }

  static constexpr int kMaxSide = 4096;

private:
  static constexpr std::size_t kSamples = 1 << 17;
  double sigma_ = 0;
  std::uint32_t seed_ = 0;
  std::vector<std::int16_t> samples_;
};

/** Pose of a figure at a moment. */
struct FigurePose {
  float sin_yaw, cos_yaw, sin_nod, cos_nod; ///< of the head
  float dx, dz;                             ///< of all, metres
};

double
wave (double time_s, double period_s)
{
  return std::sin (2 * M_PI * std::fmod (time_s, period_s) / period_s);
}

FigurePose
pose_of (double time_s, double motion)
{
  const double yaw = motion * 20 * M_PI / 180 * wave (time_s, 4);
  const double nod = motion * 4 * M_PI / 180 * wave (time_s, 2.7);
  return {static_cast<float> (std::sin (yaw)), static_cast<float> (std::cos (yaw)),
      static_cast<float> (std::sin (nod)), static_cast<float> (std::cos (nod)),
      static_cast<float> (motion * 0.015 * wave (time_s, 5)),
      static_cast<float> (motion * 0.010 * wave (time_s, 3.3))};
}

struct Direction {
  float x, y, z;
};

/** Nods, then turns, as far as the vertex belongs to the head. */
Direction
turned (const FigurePose &pose, float head, Direction p)
{
  const Direction n{
      p.x, pose.cos_nod * p.y - pose.sin_nod * p.z, pose.sin_nod * p.y + pose.cos_nod * p.z};
  const Direction t{
      pose.cos_yaw * n.x + pose.sin_yaw * n.z, n.y, pose.cos_yaw * n.z - pose.sin_yaw * n.x};
  return {p.x + head * (t.x - p.x), p.y + head * (t.y - p.y), p.z + head * (t.z - p.z)};
}

/** Lambert's law with a lamp at the upper left of the front and light from everywhere. */
float
light_on (Direction n)
{
  constexpr float kAmbient = 0.62f, kLamp = 0.38f;
  const float cosine = -0.42f * n.x + 0.68f * n.y + 0.60f * n.z;
  return kAmbient + kLamp * std::max (0.0f, cosine);
}

Status
check (const SceneSettings &s)
{
  const struct {
    const char *name;
    double value, low, high;
  } limits[] = {{"views", double (s.views), 1, kMaxViews},
      {"width", double (s.width), 16, NoiseTable::kMaxSide},
      {"height", double (s.height), 16, NoiseTable::kMaxSide}, {"arc", s.arc_deg, 0.001, 360},
      {"distance", s.distance_m, 0.5, 1.2}, {"baseline", s.baseline_m, 0.01, 0.3},
      {"noise", s.noise_sigma, 0, 20}, {"motion", s.motion, 0, 2},
      {"model-top", s.model_top_m, kTopAutomatic, kPersonHeight}, {"far", s.far_m, 1, 6},
      {"wall-texture", s.wall_texture, 0, 1}, {"wall-warmth", s.wall_warmth, 0, 1}};
  for (const auto &[name, value, low, high] : limits)
    if (!(value >= low && value <= high)) {
      char text[100];
      std::snprintf (
          text, sizeof text, "scene: %s is %g; use a value from %g to %g", name, value, low, high);
      return {StatusCode::kBadValue, text};
    }
  const bool whole_or_some =
      s.model_top_m == kTopAutomatic || s.model_top_m == kTopAll || s.model_top_m >= 0.1;
  return whole_or_some ? Status ()
                       : Status (StatusCode::kBadValue,
                             "scene: model-top is below 0.1 metres; use -1, 0 or 0.1 to 1.8");
}

View
make_view (const SceneSettings &s, int id)
{
  const double degrees = s.arc_deg >= 360 ? 360.0 * id / s.views
                         : s.views > 1    ? s.arc_deg * id / (s.views - 1) - s.arc_deg / 2
                                          : 0;
  const double a = degrees * M_PI / 180, sine = std::sin (a), cosine = std::cos (a);
  View view;
  view.id = id;
  view.name = "avatar " + std::to_string (id);
  view.width = s.width;
  view.height = s.height;
  view.intrinsics = {double (s.width), double (s.width), (s.width - 1) / 2.0, (s.height - 1) / 2.0};
  /* Columns: the camera's x (right), y (down) and z (forward) axes in the world. */
  view.world_from_view.rotation = {cosine, 0, -sine, 0, -1, 0, -sine, 0, -cosine};
  view.world_from_view.translation = {sine * s.distance_m, 0, cosine * s.distance_m};
  view.near_m = 0.45;
  view.far_m = s.far_m;
  return view;
}

/** One camera: what it keeps from picture to picture. */
struct CameraState {
  Pose world_from_camera;
  std::vector<Rgbx> room;        ///< the empty picture, once drawn
  std::vector<float> room_depth; ///< 1/z of it, 1/m
  std::vector<RasterVertex> corners;
  Rasteriser rasteriser;
};

/** A mesh as a camera sees it. */
void
project (const Mesh &mesh, const FigurePose &pose, const Intrinsics &in,
    const Pose &world_from_camera, std::vector<RasterVertex> &corners)
{
  const Pose view_from_world = world_from_camera.inverse ();
  float r[9];
  std::copy (view_from_world.rotation.begin (), view_from_world.rotation.end (), r);
  const auto tx = static_cast<float> (view_from_world.translation.x),
             ty = static_cast<float> (view_from_world.translation.y),
             tz = static_cast<float> (view_from_world.translation.z);
  const auto f = static_cast<float> (in.fx), cx = static_cast<float> (in.cx),
             cy = static_cast<float> (in.cy);
  constexpr auto kNeck = static_cast<float> (kNeckHeight);
  constexpr float kNearest = 0.05f; ///< metres: nothing is drawn in front of that

  corners.resize (mesh.vertices.size ());
  for (std::size_t i = 0; i < mesh.vertices.size (); i++) {
    const MeshVertex &v = mesh.vertices[i];
    Direction p = turned (pose, v.head, {v.x, v.y - kNeck, v.z});
    p = {p.x + pose.dx, p.y + kNeck, p.z + pose.dz};
    const Direction n = turned (pose, v.head, {v.nx, v.ny, v.nz});
    const float z = r[6] * p.x + r[7] * p.y + r[8] * p.z + tz;
    const float inverse = z > kNearest ? 1 / z : 0;
    corners[i] = {f * (r[0] * p.x + r[1] * p.y + r[2] * p.z + tx) * inverse + cx,
        f * (r[3] * p.x + r[4] * p.y + r[5] * p.z + ty) * inverse + cy, inverse, v.u, v.v,
        light_on (n), mesh.double_sided ? light_on ({-n.x, -n.y, -n.z}) : 0};
  }
}

} // namespace

struct Scene::Impl {
  SceneSettings settings;
  Rig rig, range_rig;
  Figure figure;
  NoiseTable noise;
  std::vector<CameraState> cameras;

  [[nodiscard]] ImageView<const Rgbx> room_of (CameraState &camera) const;
  void write_depth (const CameraState &camera, ImageView<std::uint16_t> depth,
      ImageView<std::uint8_t> mask) const;
  Roi bounding_box (const CameraState &camera) const;
};

ImageView<const Rgbx>
Scene::Impl::room_of (CameraState &camera) const
{
  ImageView<Rgbx> room{camera.room.data (), settings.width, settings.height,
      static_cast<std::ptrdiff_t> (settings.width * sizeof (Rgbx))};
  if (camera.room.empty ()) {
    camera.room.resize (static_cast<std::size_t> (settings.width) * settings.height);
    room.data = camera.room.data ();
    const Intrinsics &lens = rig.views[0].intrinsics;
    draw_room (lens, camera.world_from_camera, kWallRadius,
        {settings.seed, settings.wall_texture, settings.wall_warmth}, room);
    camera.room_depth = room_inverse_depth (
        lens, camera.world_from_camera, kWallRadius, settings.width, settings.height);
  }
  return room;
}

void
Scene::Impl::write_depth (
    const CameraState &camera, ImageView<std::uint16_t> depth, ImageView<std::uint8_t> mask) const
{
  const View &view = rig.views[0];
  const auto units = static_cast<float> (1 / view.depth_unit_m);
  const auto nearest = static_cast<float> (1 / view.near_m),
             farthest = static_cast<float> (1 / view.far_m);
  for (int y = 0; y < settings.height; y++) {
    const float *inverse = camera.rasteriser.row (y);
    const float *room = camera.room_depth.data () + static_cast<std::size_t> (y) * settings.width;
    if (!depth.empty ())
      for (int x = 0; x < settings.width; x++) {
        const bool valid = inverse[x] >= farthest && inverse[x] <= nearest;
        depth.row (y)[x] =
            static_cast<std::uint16_t> (valid ? static_cast<int> (units / inverse[x] + 0.5f) : 0);
      }
    if (!mask.empty ())
      for (int x = 0; x < settings.width; x++)
        mask.row (y)[x] = inverse[x] != room[x];
  }
}

Roi
Scene::Impl::bounding_box (const CameraState &camera) const
{
  int left = settings.width, right = -1, top = settings.height, bottom = -1;
  for (int y = 0; y < settings.height; y++) {
    const float *row = camera.rasteriser.row (y);
    const float *room = camera.room_depth.data () + static_cast<std::size_t> (y) * settings.width;
    int first = 0, last = settings.width - 1;
    while (first < settings.width && row[first] == room[first])
      first++;
    if (first == settings.width)
      continue;
    while (row[last] == room[last])
      last--;
    left = std::min (left, first);
    right = std::max (right, last);
    top = std::min (top, y);
    bottom = y;
  }
  return right < 0 ? Roi{} : Roi{left, top, right - left + 1, bottom - top + 1};
}

Scene::Scene () : impl_ (std::make_unique<Impl> ()) {}
Scene::~Scene () = default;

Status
Scene::create (const SceneSettings &settings, std::unique_ptr<Scene> &scene)
{
  if (Status status = check (settings); !status.ok ())
    return status;
  std::unique_ptr<Scene> made (new Scene);
  Impl &impl = *made->impl_;
  impl.settings = settings;
  if (settings.model.empty ())
    impl.figure = make_figure (settings.seed, settings.dress);
  else if (Status status = load_model ({settings.model, settings.model_top_m}, impl.figure);
           !status.ok ())
    return status;
  impl.noise.fill (settings.noise_sigma, settings.seed);
  const Vec3 offsets[kCamerasPerView] = {
      {}, {settings.baseline_m, 0, 0}, {0, -settings.baseline_m, 0}};
  impl.cameras.resize (static_cast<std::size_t> (settings.views) * kCamerasPerView);
  for (int id = 0; id < settings.views; id++) {
    View view = make_view (settings, id);
    impl.range_rig.views.push_back (view);
    for (int i = 0; i < kCamerasPerView; i++)
      impl.cameras[static_cast<std::size_t> (id * kCamerasPerView + i)].world_from_camera =
          view.world_from_view * Pose{kIdentity3, offsets[i]};
    view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, -1.0 * offsets[1]}};
    view.third = PartnerCamera{view.intrinsics, {}, {kIdentity3, -1.0 * offsets[2]}};
    impl.rig.views.push_back (view);
  }
  if (Status status = validate (impl.rig); !status.ok ())
    return status;
  scene = std::move (made);
  return {};
}

const Rig &
Scene::rig () const
{
  return impl_->rig;
}

const Rig &
Scene::range_rig () const
{
  return impl_->range_rig;
}

Status
Scene::render (int view_id, SceneCamera which, double time_s, bool empty, ImageView<Rgbx> colour,
    ImageView<std::uint16_t> depth, ImageView<std::uint8_t> mask)
{
  const SceneSettings &s = impl_->settings;
  if (view_id < 0 || view_id >= s.views)
    return {StatusCode::kNotFound,
        "scene: no view " + std::to_string (view_id) + " of " + std::to_string (s.views)};
  const auto fits = [&] (const auto &picture) {
    return picture.width == s.width && picture.height == s.height;
  };
  if (!fits (colour) || (!depth.empty () && !fits (depth)) || (!mask.empty () && !fits (mask)))
    return {StatusCode::kBadSize, "scene: an image is not " + std::to_string (s.width) + " x " +
                                      std::to_string (s.height) + " pixels"};
  const int index = view_id * kCamerasPerView + static_cast<int> (which);
  CameraState &camera = impl_->cameras[static_cast<std::size_t> (index)];
  const ImageView<const Rgbx> room = impl_->room_of (camera);
  for (int y = 0; y < s.height; y++)
    std::memcpy (colour.row (y), room.row (y), sizeof (Rgbx) * static_cast<std::size_t> (s.width));
  camera.rasteriser.begin (s.width, s.height, camera.room_depth);
  for (std::size_t i = 0; !empty && i < impl_->figure.size (); i++) {
    project (impl_->figure[i], pose_of (time_s, s.motion), impl_->rig.views[0].intrinsics,
        camera.world_from_camera, camera.corners);
    camera.rasteriser.draw (camera.corners, impl_->figure[i], colour);
  }
  impl_->write_depth (camera, depth, mask);
  impl_->noise.add (colour, index, time_s);
  return {};
}

Status
Scene::render_range (std::span<const RangeImage> images, double time_s, bool empty,
    std::span<Roi> boxes, int n_threads)
{
  if (boxes.size () != images.size () || images.size () > kMaxViews)
    return {StatusCode::kBadSize, "scene: needs one box for each range image"};
  std::array<Status, kMaxViews> results;
  in_parallel (images.size (), n_threads, [&] (std::size_t i) {
    const RangeImage &image = images[i];
    results[i] =
        render (image.view_id, SceneCamera::kLeft, time_s, empty, image.colour, image.depth, {});
    if (results[i].ok ())
      boxes[i] = impl_->bounding_box (
          impl_->cameras[static_cast<std::size_t> (image.view_id * kCamerasPerView)]);
  });
  for (std::size_t i = 0; i < images.size (); i++)
    if (!results[i].ok ())
      return results[i];
  return {};
}

} // namespace rangecast
