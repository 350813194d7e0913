/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frames for tests of the cylinder, made by casting rays at simple surfaces. */
#pragma once

#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <rangecast/overlap/cylinder_filter.hpp>
#include <vector>

#include "../test-support.hpp"

namespace rangecast::testing {

inline constexpr int kWidth = 320, kHeight = 240;
using Surface = std::function<double (Vec3 origin, Vec3 direction)>;

inline Surface
ellipsoid (Vec3 centre, Vec3 radii)
{
  return [=] (Vec3 o, Vec3 d) {
    o = o - centre;
    o = {o.x / radii.x, o.y / radii.y, o.z / radii.z};
    d = {d.x / radii.x, d.y / radii.y, d.z / radii.z};
    const double a = dot (d, d), b = dot (o, d), c = dot (o, o) - 1, root = b * b - a * c;
    return root < 0 ? INFINITY : (-b - std::sqrt (root)) / a;
  };
}

inline Surface
both (const Surface &a, const Surface &b)
{
  return [=] (Vec3 o, Vec3 d) { return std::min (a (o, d), b (o, d)); };
}

/* A square patch that is turned that way (0: faces +z). */
inline Surface
patch (double turn_deg, Vec3 centre = {0, 0, 0.1}, double half = 0.03)
{
  const double a = turn_deg * M_PI / 180;
  const Vec3 normal{std::sin (a), 0, std::cos (a)};
  return [=] (Vec3 o, Vec3 d) {
    const double s = dot (centre - o, normal) / dot (d, normal);
    const Vec3 p = o + s * d - centre;
    return s > 0 && std::abs (p.y) < half && norm (p - Vec3{0, p.y, 0}) < half ? s : INFINITY;
  };
}

/* The range images of one moment, with their pixels. */
class Frame {
public:
  explicit Frame (const Rig &rig) : rig_ (rig)
  {
    for (const View &view : rig.views) {
      depth.emplace_back (view.width, view.height);
      colour.emplace_back (view.width, view.height);
    }
  }
  Frame (const Rig &rig, const Surface &surface) : Frame (rig)
  {
    for (std::size_t i = 0; i < rig.views.size (); i++) {
      const View &view = rig.views[i];
      for (int v = 0; v < view.height; v++)
        for (int u = 0; u < view.width; u++) {
          const Vec3 ray = view.world_from_view.rotation * view.intrinsics.unproject (u, v, 1);
          const double z = surface (view.world_from_view.translation, ray);
          depth[i].view ().at (u, v) = z < 6 ? static_cast<std::uint16_t> (z * 1e4 + 0.5) : 0;
        }
    }
  }

  std::vector<RangeImage> images ()
  {
    std::vector<RangeImage> all;
    for (std::size_t i = 0; i < rig_.views.size (); i++) {
      const View &view = rig_.views[i];
      all.push_back (
          {view.id, {0, 0, view.width, view.height}, depth[i].view (), colour[i].view (), 0});
    }
    return all;
  }

  /* Errors as stereo makes them: of neighbouring pixels alike, growing with the square of depth. */
  void add_noise (std::mt19937 &random, double disparity_px)
  {
    std::normal_distribution<float> normal (0, 1);
    for (std::size_t i = 0; i < depth.size (); i++) {
      ImageView<std::uint16_t> image = depth[i].view ();
      std::vector<float> white (static_cast<std::size_t> (image.width) * image.height);
      for (float &value : white)
        value = normal (random);
      for (int v = 1; v + 1 < image.height; v++)
        for (int u = 1; u + 1 < image.width; u++) {
          std::uint16_t &d = image.at (u, v);
          float sum = 0;
          for (int k = 0; k < 9; k++)
            sum += white[static_cast<std::size_t> (v + k / 3 - 1) * image.width + u + k % 3 - 1];
          const double z = d * 1e-4, error = z * z / (kWidth * 0.1) * disparity_px * sum / 3;
          d = d && z < 1.2 ? static_cast<std::uint16_t> ((z + error) * 1e4) : 0;
        }
    }
  }

  std::size_t points (std::size_t i)
  {
    ImageView<std::uint16_t> image = depth[i].view ();
    std::size_t n = 0;
    for (int v = 0; v < image.height; v++)
      n += static_cast<std::size_t> (
          image.width - std::count (image.row (v), image.row (v) + image.width, 0));
    return n;
  }

  std::vector<Image<std::uint16_t>> depth;
  std::vector<Image<Rgbx>> colour;

private:
  Rig rig_;
};

inline bool
operator== (Frame &a, Frame &b)
{
  for (std::size_t i = 0; i < a.depth.size (); i++) {
    ImageView<std::uint16_t> x = a.depth[i].view (), y = b.depth[i].view ();
    for (int v = 0; v < x.height; v++)
      if (std::memcmp (x.row (v), y.row (v), 2 * static_cast<std::size_t> (x.width)) != 0)
        return false;
  }
  return true;
}

inline CylinderResult
run (CylinderFilter &filter, Frame &frame, const CylinderSettings &settings = {})
{
  CylinderResult result;
  const Status status = filter.process (frame.images (), settings, result);
  EXPECT_TRUE (status.ok ()) << status.message ();
  return result;
}

inline CylinderSettings
about_world_axis ()
{
  CylinderSettings settings;
  settings.axis = AxisMode::kWorld;
  return settings;
}

} // namespace rangecast::testing
