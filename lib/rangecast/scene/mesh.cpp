/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "pattern.hpp"

namespace rangecast {
namespace {

std::uint8_t
average (int a, int b, int c, int d)
{
  return static_cast<std::uint8_t> ((a + b + c + d + 2) / 4);
}

/* The highest threshold that at least this share of the pixels reaches. */
int
threshold_of (const std::vector<Rgbx> &pixels, double share)
{
  std::size_t histogram[256] = {}, above = 0;
  for (const Rgbx &p : pixels)
    histogram[p.x]++;
  int threshold = 256;
  while (threshold > 1 && double (above) < share * double (pixels.size ()))
    above += histogram[--threshold];
  return threshold;
}

struct Bounds {
  float low[3] = {1e30f, 1e30f, 1e30f}, high[3] = {-1e30f, -1e30f, -1e30f};

  [[nodiscard]] double side (int axis) const { return double (high[axis]) - low[axis]; }
};

/* Without vertices that belong to no triangle. */
Bounds
bounds_of (const Figure &figure)
{
  Bounds bounds;
  for (const Mesh &mesh : figure)
    for (const auto &triangle : mesh.triangles)
      for (const std::uint32_t index : triangle)
        for (int i = 0; i < 3; i++) {
          const float value = (&mesh.vertices[index].x)[i];
          bounds.low[i] = std::min (bounds.low[i], value);
          bounds.high[i] = std::max (bounds.high[i], value);
        }
  return bounds;
}

void
move_to_origin (Figure &figure, const Bounds &bounds, double scale)
{
  for (int i = 0; i < 3; i++) {
    const double centre = (double (bounds.high[i]) + bounds.low[i]) / 2;
    for (Mesh &mesh : figure)
      for (MeshVertex &v : mesh.vertices)
        (&v.x)[i] = static_cast<float> (scale * ((&v.x)[i] - centre));
  }
}

/* Keeps the triangles that lie above a floor and near the axis. */
void
cut (Figure &figure, double floor_y, double radius)
{
  for (Mesh &mesh : figure) {
    std::erase_if (mesh.triangles, [&] (const auto &triangle) {
      return std::ranges::any_of (triangle, [&] (std::uint32_t index) {
        const MeshVertex &v = mesh.vertices[index];
        return v.y < floor_y || std::hypot (v.x, v.z) > radius;
      });
    });
    drop_unused_vertices (mesh);
  }
  std::erase_if (figure, [] (const Mesh &mesh) { return mesh.triangles.empty (); });
}

} // namespace

MipMap::MipMap (int width, int height, std::vector<Rgbx> pixels, std::uint8_t alpha_cutoff)
{
  const auto covered = std::ranges::count_if (
      pixels, [alpha_cutoff] (const Rgbx &p) { return p.x >= alpha_cutoff; });
  const double share = double (covered) / double (pixels.size ());
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
            average (a.g, b.g, c.g, d.g), average (a.b, b.b, c.b, d.b),
            average (a.x, b.x, c.x, d.x)};
      }
    if (alpha_cutoff > 0 && covered > 0) {
      const int threshold = threshold_of (half.pixels, share);
      for (Rgbx &p : half.pixels)
        p.x = static_cast<std::uint8_t> (std::min (p.x * alpha_cutoff / threshold, 255));
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

std::shared_ptr<const MipMap>
Mesh::plain_texture (Rgbx colour)
{
  return std::make_shared<MipMap> (1, 1, std::vector<Rgbx>{colour});
}

void
drop_unused_vertices (Mesh &mesh)
{
  constexpr std::uint32_t kUnused = UINT32_MAX;
  std::vector<std::uint32_t> place (mesh.vertices.size (), kUnused);
  std::vector<MeshVertex> vertices;
  std::vector<Rgbx> colours;
  for (auto &triangle : mesh.triangles)
    for (std::uint32_t &index : triangle) {
      if (place[index] == kUnused) {
        place[index] = static_cast<std::uint32_t> (vertices.size ());
        vertices.push_back (mesh.vertices[index]);
        if (!mesh.colours.empty ())
          colours.push_back (mesh.colours[index]);
      }
      index = place[index];
    }
  mesh.vertices = std::move (vertices);
  mesh.colours = std::move (colours);
}

bool
fit_figure (Figure &figure, double top_m)
{
  constexpr double kSize = 0.5, kReach = 0.45, kNeckBelowCrown = 0.27; /* metres */
  Bounds bounds = bounds_of (figure);
  if (figure.empty () || bounds.side (1) < 0)
    return false;
  const bool stands = bounds.side (1) >= 3.5 * bounds.side (2) && bounds.side (2) > 0;
  if (top_m == kTopAutomatic)
    top_m = stands ? kSize : kTopAll;
  double scale = kSize / std::max ({bounds.side (0), bounds.side (1), 1e-20});
  if (top_m > 0) {
    scale = kPersonHeight / std::max (bounds.side (1), 1e-20);
    move_to_origin (figure, bounds, scale);
    cut (figure, kPersonHeight / 2 - top_m, kReach);
    bounds = bounds_of (figure);
    scale = 1;
    if (figure.empty ())
      return false;
  }
  move_to_origin (figure, bounds, scale);
  /* A bust has its neck where the built-in figure has it. */
  const double person = top_m > 0 ? 1 : kSize / kPersonHeight;
  const double chin = stands ? bounds.side (1) * scale / 2 - person * kNeckBelowCrown : -0.01;
  const double spread = stands ? person * 0.08 : 0.08;
  for (Mesh &mesh : figure)
    for (MeshVertex &v : mesh.vertices)
      v.head = static_cast<float> (smooth_step (chin - spread, chin, v.y));
  return true;
}

} // namespace rangecast
