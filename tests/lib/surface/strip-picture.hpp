/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What striprender's mode=strips draws of a frame set, without OpenGL: how far away the surface in
 * each pixel is. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/strips.hpp>
#include <span>
#include <vector>

namespace rangecast::testing {

/** Where an orbiting camera stands, degrees. */
struct Angle {
  double azimuth, elevation;
};

/** A picture of distances; infinity where nothing is drawn. */
class StripPicture {
public:
  StripPicture (int width, int height) : width_ (width), height_ (height) {}

  void draw (const Rig &rig, std::span<const RangeImage> images, const Angle &angle)
  {
    distance_.assign (std::size_t (width_) * std::size_t (height_), INFINITY);
    Orbit orbit;
    orbit.azimuth_deg = angle.azimuth;
    orbit.elevation_deg = angle.elevation;
    clip_ =
        orbit_matrices (scene_frame (rig), orbit, double (width_) / height_, true).clip_from_world;
    for (const RangeImage &image : images)
      if (const View *view = rig.find (image.view_id); view && !image.depth.empty ())
        draw_view (*view, image);
  }

  [[nodiscard]] int width () const { return width_; }
  [[nodiscard]] int height () const { return height_; }
  [[nodiscard]] float distance (int x, int y) const
  {
    return distance_[std::size_t (y) * std::size_t (width_) + std::size_t (x)];
  }

private:
  struct Vertex {
    Vec3 ray;       /* from the camera that saw it, world, metres */
    double x, y, w; /* pixels of this picture; distance along the viewer's axis */
  };

  /* As striprender's vertex shader places it: ends of bands lie beside their pixels. */
  Vertex vertex (const View &view, const RangeImage &image, StripVertex v) const
  {
    const int x = int (v & 8191), y = int (v >> 13 & 8191);
    const double right = 0.25 * (double (v >> 26 & 7) - 3), down = 0.25 * (double (v >> 29) - 3);
    const double depth = image.depth.at (x, y);
    const auto rise = [&] (int step_x, int step_y, double offset) {
      const int sign = offset > 0 ? 1 : -1, u = x - sign * step_x, w = y - sign * step_y;
      if (offset == 0 || u < 0 || w < 0 || u >= image.depth.width || w >= image.depth.height)
        return 0.0;
      const double before = image.depth.at (u, w), most = depth / view.intrinsics.fx;
      const bool joined = before > 0 && std::abs (depth - before) <= kDepthStep * depth;
      return joined ? sign * offset * std::clamp (depth - before, -most, most) : 0.0;
    };
    const double z = (depth + rise (1, 0, right) + rise (0, 1, down)) * view.depth_unit_m;
    const Vec3 seen =
        view.intrinsics.unproject (x + right + image.roi.x, y + down + image.roi.y, z);
    const Vec3 ray = view.world_from_view.rotation * seen;
    const Vec3 p = ray + view.world_from_view.translation;
    const auto row = [&] (int i) {
      return clip_[i] * p.x + clip_[4 + i] * p.y + clip_[8 + i] * p.z + clip_[12 + i];
    };
    const double w = row (3);
    return {ray, (row (0) / w + 1) / 2 * width_, (row (1) / w + 1) / 2 * height_, w};
  }

  void draw_view (const View &view, const RangeImage &image)
  {
    StripSettings settings;
    settings.depth_step = kDepthStep;
    StripResult result;
    build_strips (image, settings, strips_, result);
    vertices_.clear ();
    for (const StripVertex v : strips_)
      vertices_.push_back (vertex (view, image, v));
    for (std::size_t i = 0; i + 2 < vertices_.size (); i++)
      draw_triangle (vertices_[i], vertices_[i + 1], vertices_[i + 2]);
  }

  /* Positive where c lies to the left of the way from a to b, in 1/256 pixels, as OpenGL rounds. */
  using Point = std::array<std::int64_t, 2>;
  static std::int64_t side (const Point &a, const Point &b, const Point &c)
  {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  }

  /* Each side of a triangle belongs to one of the two that share it. */
  static bool owns_side (const Point &a, const Point &b)
  {
    return a[1] == b[1] ? b[0] > a[0] : b[1] < a[1];
  }

  void draw_triangle (const Vertex &a, Vertex b, Vertex c)
  {
    if (!(a.w > 0.01 && b.w > 0.01 && c.w > 0.01))
      return;
    const auto fixed = [] (const Vertex &v) {
      return Point{std::llround (v.x * 256), std::llround (v.y * 256)};
    };
    const Point p = fixed (a);
    Point q = fixed (b), r = fixed (c);
    std::int64_t area = side (p, q, r);
    /* A front is a side that its own camera sees. Seen from there, as from here, the sign of the
     * volume of three rays tells which way round the corners go. */
    const double own = dot (a.ray, cross (b.ray, c.ray));
    if (area == 0 || (area > 0) != (own > 0))
      return;
    if (area < 0) {
      std::swap (q, r);
      std::swap (b, c);
      area = -area;
    }
    const auto [left, right] = std::minmax ({p[0], q[0], r[0]});
    const auto [top, bottom] = std::minmax ({p[1], q[1], r[1]});
    const int x0 = int (std::max<std::int64_t> (0, (left - 128) >> 8)),
              x1 = int (std::min<std::int64_t> (width_ - 1, right >> 8)),
              y0 = int (std::max<std::int64_t> (0, (top - 128) >> 8)),
              y1 = int (std::min<std::int64_t> (height_ - 1, bottom >> 8));
    const std::int64_t least[] = {
        owns_side (q, r) ? 0 : 1, owns_side (r, p) ? 0 : 1, owns_side (p, q) ? 0 : 1};
    for (int y = y0; y <= y1; y++)
      for (int x = x0; x <= x1; x++) {
        const Point at{x * 256 + 128, y * 256 + 128};
        const std::int64_t at_a = side (q, r, at), at_b = side (r, p, at), at_c = side (p, q, at);
        if (at_a < least[0] || at_b < least[1] || at_c < least[2])
          continue;
        const double per_w =
            (double (at_a) / a.w + double (at_b) / b.w + double (at_c) / c.w) / double (area);
        float &distance = distance_[std::size_t (y) * std::size_t (width_) + std::size_t (x)];
        distance = std::min (distance, float (1 / per_w));
      }
  }

  static constexpr double kDepthStep = StripSettings{}.depth_step;
  int width_, height_;
  Mat4 clip_{};
  std::vector<float> distance_;
  std::vector<StripVertex> strips_;
  std::vector<Vertex> vertices_;
};

/** What is missing in pictures of what is left of a frame set. */
struct Missing {
  std::size_t drawn = 0; ///< pixels that the whole frame set draws
  /** Of those, pixels with nothing. On the outline are those that have an empty pixel beside them
   *  in the picture of the whole: one camera alone draws it, up to three quarters of a pixel of its
   *  own too far out. */
  std::size_t inside = 0, outline = 0;
  std::size_t deeper = 0; ///< pixels whose surface is more than kDeeper farther away than before
  static constexpr float kDeeper = 0.01f; ///< metres

  void add (const StripPicture &whole, const StripPicture &rest)
  {
    for (int y = 0; y < whole.height (); y++)
      for (int x = 0; x < whole.width (); x++) {
        const float before = whole.distance (x, y), after = rest.distance (x, y);
        if (!std::isfinite (before))
          continue;
        drawn++;
        deeper += std::isfinite (after) && after - before > kDeeper;
        if (!std::isfinite (after))
          (is_inside (whole, x, y) ? inside : outline)++;
      }
  }

private:
  static bool is_inside (const StripPicture &picture, int x, int y)
  {
    for (int v = std::max (0, y - 1); v <= std::min (y + 1, picture.height () - 1); v++)
      for (int u = std::max (0, x - 1); u <= std::min (x + 1, picture.width () - 1); u++)
        if (!std::isfinite (picture.distance (u, v)))
          return false;
    return true;
  }
};

} // namespace rangecast::testing
