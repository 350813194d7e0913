/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "head.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <rangecast/scene/model.hpp>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

using namespace rangecast;

namespace bench {

const char *
name_of (DepthNoise noise)
{
  return noise == DepthNoise::kExact ? "exact" : noise == DepthNoise::kSmooth ? "smooth" : "stereo";
}

namespace {

constexpr double kStereoNoise = 1.5; ///< grey levels
constexpr double kNeck = -0.06;      ///< metres: what is above belongs to the head

SceneSettings
scene_settings (const HeadSettings &settings, double noise)
{
  SceneSettings s;
  s.views = settings.views;
  s.width = settings.width;
  s.height = settings.height;
  s.noise_sigma = noise;
  s.motion = 0; /* so that the mesh as it is loaded is the truth */
  s.model = settings.model;
  s.dress = settings.dress;
  return s;
}

template <typename T>
ImageView<T>
view_of (std::vector<T> &pixels, const View &view)
{
  pixels.resize (std::size_t (view.width) * view.height);
  return {pixels.data (), view.width, view.height, std::ptrdiff_t (view.width * sizeof (T))};
}

Status
make_surface (const HeadSettings &settings, Head &head)
{
  Figure figure;
  if (settings.model.empty ())
    figure = make_figure (SceneSettings{}.seed, settings.dress);
  else if (Status s = load_model ({settings.model}, figure); !s.ok ())
    return s;
  std::vector<Vec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Vec3 nose{0, 0, -1};
  for (const Mesh &mesh : figure) {
    const auto first = static_cast<std::uint32_t> (vertices.size ());
    for (const MeshVertex &v : mesh.vertices) {
      vertices.push_back ({v.x, v.y, v.z});
      if (v.y > kNeck && v.z > nose.z)
        nose = vertices.back ();
    }
    for (const auto &t : mesh.triangles)
      triangles.push_back ({first + t[0], first + t[1], first + t[2]});
  }
  head.nose_y = nose.y;
  head.surface = std::make_shared<Surface> (std::move (vertices), std::move (triangles));
  return {};
}

void
add_smooth_noise (const View &view, std::vector<std::uint16_t> &depth)
{
  constexpr double kSigmaM = 0.003, kReach = 4; /* metres, pixels */
  cv::Mat noise (view.height, view.width, CV_64F);
  cv::RNG random (std::uint64_t (view.id) + 1);
  random.fill (noise, cv::RNG::NORMAL, 0, 1);
  cv::GaussianBlur (noise, noise, {}, kReach);
  cv::Scalar mean, deviation;
  cv::meanStdDev (noise, mean, deviation);
  noise *= kSigmaM / view.depth_unit_m / deviation[0];
  for (int i = 0; i < int (depth.size ()); i++)
    if (std::uint16_t &d = depth[std::size_t (i)])
      d = std::uint16_t (std::lround (d + noise.at<double> (i / view.width, i % view.width)));
}

/* Depth of the person by stereo: what roiextract would leave, were it perfect. */
Status
match (
    const HeadSettings &settings, Head &head, const std::vector<std::vector<std::uint8_t>> &masks)
{
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (scene_settings (settings, kStereoNoise), scene); !s.ok ())
    return s;
  for (std::size_t i = 0; i < head.rig.views.size (); i++) {
    const View &view = scene->rig ().views[i];
    std::vector<Rgbx> left, right;
    const ImageView<Rgbx> l = view_of (left, view), r = view_of (right, view);
    Status s = scene->render (view.id, SceneCamera::kLeft, 0, false, l, {}, {});
    if (s.ok ())
      s = scene->render (view.id, SceneCamera::kRight, 0, false, r, {}, {});
    StereoDepth stereo;
    if (s.ok ())
      s = stereo.set (view, {});
    const RangeImage image{view.id, {0, 0, view.width, view.height},
        view_of (head.set.depth[i], view), view_of (head.set.colour[i], view), 0};
    if (s.ok ())
      s = stereo.process (l, r, image);
    if (!s.ok ())
      return s;
    for (std::size_t k = 0; k < masks[i].size (); k++)
      head.set.depth[i][k] = masks[i][k] ? head.set.depth[i][k] : kInvalidDepth;
  }
  return {};
}

/* The pictures with noise. */
Status
take_pictures (const HeadSettings &settings, Head &head)
{
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (scene_settings (settings, settings.colour_noise), scene); !s.ok ())
    return s;
  for (std::size_t i = 0; i < head.rig.views.size (); i++) {
    const View &view = head.rig.views[i];
    if (Status s = scene->render (
            view.id, SceneCamera::kLeft, 0, false, view_of (head.set.colour[i], view), {}, {});
        !s.ok ())
      return s;
  }
  return {};
}

/* Turns each camera about itself, and moves it. */
void
disturb (Rig &rig, double move_m, double turn_deg)
{
  std::mt19937 random (7);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    const Vec3 v{normal (random), normal (random), normal (random)};
    return 1 / norm (v) * v;
  };
  for (View &view : rig.views) {
    const Vec3 k = direction (), move = direction ();
    const double a = turn_deg * M_PI / 180, s = std::sin (a), c = 1 - std::cos (a);
    const Mat3 cross_k = {0, -k.z, k.y, k.z, 0, -k.x, -k.y, k.x, 0}, twice = cross_k * cross_k;
    Mat3 turn = kIdentity3; /* Rodrigues' formula */
    for (std::size_t i = 0; i < 9; i++)
      turn[i] += s * cross_k[i] + c * twice[i];
    view.world_from_view.rotation = view.world_from_view.rotation * turn;
    view.world_from_view.translation = view.world_from_view.translation + move_m * move;
  }
}

} // namespace

Status
make_head (const HeadSettings &settings, Head &head)
{
  if (Status s = make_surface (settings, head); !s.ok ())
    return s;
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (scene_settings (settings, 0), scene); !s.ok ())
    return s;
  head.rig = head.set.rig = scene->range_rig ();
  const std::size_t n = head.rig.views.size ();
  head.depth.resize (n);
  head.colour.resize (n);
  std::vector<std::vector<std::uint8_t>> masks (n);
  for (std::size_t i = 0; i < n; i++) {
    const View &view = head.rig.views[i];
    if (Status s =
            scene->render (view.id, SceneCamera::kLeft, 0, false, view_of (head.colour[i], view),
                view_of (head.depth[i], view), view_of (masks[i], view));
        !s.ok ())
      return s;
  }
  head.set.depth = head.depth;
  head.set.colour = head.colour;
  if (settings.colour_noise > 0)
    if (Status s = take_pictures (settings, head); !s.ok ())
      return s;
  if (settings.noise == DepthNoise::kStereo)
    if (Status s = match (settings, head, masks); !s.ok ())
      return s;
  if (settings.noise == DepthNoise::kSmooth)
    for (std::size_t i = 0; i < n; i++)
      add_smooth_noise (head.rig.views[i], head.set.depth[i]);
  disturb (head.set.rig, settings.pose_mm / 1000, settings.pose_deg);
  head.set.fresh = head.set.depth;
  head.set.fresh_colour = head.set.colour;
  return {};
}

} // namespace bench
