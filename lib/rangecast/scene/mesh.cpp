/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "pattern.hpp"

namespace rangecast {

static std::uint8_t
average (int a, int b, int c, int d)
{
  return static_cast<std::uint8_t> ((a + b + c + d + 2) / 4);
}

MipMap::MipMap (int width, int height, std::vector<Rgbx> pixels)
{
  levels_.push_back ({width, height, std::move (pixels)});
  while (levels_.back ().width > 1 || levels_.back ().height > 1) {
    const Level &big = levels_.back ();
    Level half{std::max (1, big.width / 2), std::max (1, big.height / 2), {}};
    half.pixels.resize (static_cast<std::size_t> (half.width) * half.height);
    for (int y = 0; y < half.height; y++)
      for (int x = 0; x < half.width; x++) {
        const int x0 = 2 * x, x1 = std::min (2 * x + 1, big.width - 1);
        const int y0 = 2 * y, y1 = std::min (2 * y + 1, big.height - 1);
        const auto at = [&] (int i, int j) {
          return big.pixels[static_cast<std::size_t> (j) * big.width + i];
        };
        const Rgbx a = at (x0, y0), b = at (x1, y0), c = at (x0, y1), d = at (x1, y1);
        half.pixels[static_cast<std::size_t> (y) * half.width + x] = {average (a.r, b.r, c.r, d.r),
            average (a.g, b.g, c.g, d.g), average (a.b, b.b, c.b, d.b), 0};
      }
    levels_.push_back (std::move (half));
  }
}

ImageView<const Rgbx>
MipMap::level (int i) const
{
  const Level &l = levels_[static_cast<std::size_t> (i)];
  return {
      l.pixels.data (), l.width, l.height, static_cast<std::ptrdiff_t> (l.width * sizeof (Rgbx))};
}

void
compute_normals (Mesh &mesh)
{
  std::map<std::tuple<float, float, float>, Vec3> sums;
  const auto key = [] (const MeshVertex &v) { return std::tuple (v.x, v.y, v.z); };
  const auto point = [] (const MeshVertex &v) { return Vec3{v.x, v.y, v.z}; };
  for (const auto &t : mesh.triangles) {
    const auto &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vec3 n = cross (point (b) - point (a), point (c) - point (a));
    for (const auto *v : {&a, &b, &c})
      sums[key (*v)] = sums[key (*v)] + n;
  }
  for (MeshVertex &v : mesh.vertices) {
    const Vec3 n = sums[key (v)];
    const double length = std::max (norm (n), 1e-30);
    v.nx = static_cast<float> (n.x / length);
    v.ny = static_cast<float> (n.y / length);
    v.nz = static_cast<float> (n.z / length);
  }
}

void
fit_figure (Mesh &mesh)
{
  float low[3] = {1e30f, 1e30f, 1e30f}, high[3] = {-1e30f, -1e30f, -1e30f};
  for (const MeshVertex &v : mesh.vertices)
    for (int i = 0; i < 3; i++) {
      low[i] = std::min (low[i], (&v.x)[i]);
      high[i] = std::max (high[i], (&v.x)[i]);
    }
  constexpr float kWidth = 0.5f;
  const float scale = kWidth / std::max (high[0] - low[0], 1e-20f);
  for (MeshVertex &v : mesh.vertices) {
    for (int i = 0; i < 3; i++)
      (&v.x)[i] = scale * ((&v.x)[i] - (low[i] + high[i]) / 2);
    v.head = static_cast<float> (smooth_step (-0.09, -0.01, v.y));
  }
}

} // namespace rangecast
