/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "input.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <rangecast/roi/bounding_box.hpp>
#include <rangecast/scene/pattern.hpp>

using namespace rangecast;

namespace bench {

Picture::Picture (int w, int h)
    : width (w), height (h), depth (std::size_t (w) * std::size_t (h)), colour (depth.size ())
{
}

RangeImage
Picture::image (int view_id, const Roi &roi)
{
  return {view_id, roi, {depth.data (), width, height, width * 2},
      {colour.data (), width, height, width * 4}, 0};
}

ViewPictures
make_view (int view_id, Picture whole)
{
  ViewPictures view;
  view.view_id = view_id;
  for (std::size_t i = 0; i < whole.depth.size (); i++)
    if (!whole.depth[i])
      whole.colour[i] = {};
  view.roi = bounding_box (whole.image (view_id, {0, 0, whole.width, whole.height}), 0);
  view.person = Picture (view.roi.width, view.roi.height);
  for (int y = 0; y < view.roi.height; y++) {
    const std::ptrdiff_t from = std::ptrdiff_t{view.roi.y + y} * whole.width + view.roi.x;
    const std::ptrdiff_t to = std::ptrdiff_t{y} * view.roi.width;
    std::copy_n (whole.depth.begin () + from, view.roi.width, view.person.depth.begin () + to);
    std::copy_n (whole.colour.begin () + from, view.roi.width, view.person.colour.begin () + to);
  }
  return view;
}

std::size_t
count_points (const Input &input)
{
  std::size_t points = 0;
  for (const FrameSet &set : input.sets)
    for (const ViewPictures &view : set)
      points += std::size_t (std::ranges::count_if (
          view.person.depth, [] (std::uint16_t depth) { return depth != 0; }));
  return points;
}

/* Noise of depth as of a sensor: independent, normal (as the sum of four even numbers nearly is).
 */
static void
add_depth_noise (const View &view, double sigma_mm, int frame, Picture &to)
{
  const double sigma = sigma_mm / 1e3 / view.depth_unit_m; /* depth units */
  const double least = std::ceil (view.near_m / view.depth_unit_m);
  const double most = std::floor (view.far_m / view.depth_unit_m);
  for (std::size_t i = 0; i < to.depth.size (); i++) {
    if (!to.depth[i])
      continue;
    const std::uint64_t random =
        mix64 (i + (std::uint64_t (frame) << 32) + (std::uint64_t (view.id) << 56));
    double sum = -2 * 65535; /* of four numbers of 16 bits: variance 4 x 65536^2 / 12 */
    for (int k = 0; k < 64; k += 16)
      sum += double (random >> k & 0xffff);
    const double noisy = to.depth[i] + sigma * sum / (65536 / std::sqrt (3.0));
    to.depth[i] = std::uint16_t (std::round (std::clamp (noisy, least, most)));
  }
}

Status
render_input (const SceneSettings &settings, int frames, double depth_noise_mm, Input &input)
{
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (settings, scene); !s.ok ())
    return s;
  input.rig = scene->range_rig ();
  for (int frame = 0; frame < frames; frame++) {
    FrameSet set;
    for (const View &view : input.rig.views) {
      Picture p (view.width, view.height);
      const RangeImage image = p.image (view.id, {0, 0, view.width, view.height});
      if (Status s = scene->render (view.id, SceneCamera::kLeft, 0.5 + frame / 15.0, false,
              image.colour, image.depth, {});
          !s.ok ())
        return s;
      if (depth_noise_mm > 0)
        add_depth_noise (view, depth_noise_mm, frame, p);
      set.push_back (make_view (view.id, std::move (p)));
      if (set.back ().roi.empty ())
        set.pop_back ();
    }
    input.sets.push_back (std::move (set));
  }
  input.name = settings.model.empty () ? "built-in figure" : settings.model;
  return {};
}

} // namespace bench
