/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "furnishing.hpp"

#include <algorithm>
#include <cmath>

#include "pattern.hpp"

namespace rangecast {
namespace {

constexpr int kTextureSize = 64;
constexpr int kMapSize = 256;
/* Width of the shadow's rim on each side, pixels of the map: of a lamp with a shade. */
constexpr int kRim = 2;

/* Six faces of four corners each, so that every face has its own normal. */
void
add_box (Mesh &mesh, Vec3 from, Vec3 to)
{
  for (int axis = 0; axis < 3; axis++)
    for (const int side : {0, 1}) {
      const auto first = static_cast<std::uint32_t> (mesh.vertices.size ());
      const int a = (axis + 1) % 3, b = (axis + 2) % 3;
      for (const auto &[i, j] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
        const double low[] = {from.x, from.y, from.z}, high[] = {to.x, to.y, to.z};
        MeshVertex v{};
        (&v.x)[axis] = static_cast<float> (side ? high[axis] : low[axis]);
        (&v.x)[a] = static_cast<float> (i ? high[a] : low[a]);
        (&v.x)[b] = static_cast<float> (j ? high[b] : low[b]);
        (&v.nx)[axis] = side ? 1.f : -1.f;
        v.u = static_cast<float> (i), v.v = static_cast<float> (j);
        mesh.vertices.push_back (v);
      }
      const std::uint32_t s = side ? 1 : 3, t = side ? 3 : 1; /* outside is on the left hand */
      mesh.triangles.push_back ({first, first + s, first + 2});
      mesh.triangles.push_back ({first, first + 2, first + t});
    }
}

MipMap
wood (std::uint32_t seed)
{
  std::vector<Rgbx> pixels;
  for (int j = 0; j < kTextureSize; j++)
    for (int i = 0; i < kTextureSize; i++) {
      const Vec3 grain{0.002 * i, 0.012 * j, 0};
      const double light = 1 + 0.3 * smooth_noise (grain, 0.05, 3, seed + 40);
      pixels.push_back ({to_byte (150 * light), to_byte (108 * light), to_byte (72 * light), 0});
    }
  return {kTextureSize, kTextureSize, std::move (pixels)};
}

/* A camera that looks along `forward`, level. */
Pose
looking (Vec3 from, Vec3 forward)
{
  const Vec3 z = (1 / norm (forward)) * forward;
  Vec3 x = cross (z, {0, 1, 0}); /* right, for y is up in the world */
  x = (1 / norm (x)) * x;
  const Vec3 y = cross (z, x);
  return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}, from};
}

} // namespace

Mesh
make_chair (std::uint32_t seed)
{
  Mesh mesh;
  const double x = -0.55, z = -0.9, floor = -1.0, half = 0.21, leg = 0.03;
  add_box (mesh, {x - half, -0.42, z - half}, {x + half, 0.02, z - half + 0.04});
  add_box (mesh, {x - half, -0.55, z - half}, {x + half, -0.51, z + half});
  for (const double side : {x - half, x + half - leg})
    for (const double back : {z - half, z + half - leg})
      add_box (mesh, {side, floor, back}, {side + leg, back < z ? -0.42 : -0.55, back + leg});
  mesh.texture = std::make_shared<MipMap> (wood (seed));
  return mesh;
}

ShadowMap::ShadowMap ()
{
  const double centre = (kMapSize - 1) / 2.0;
  intrinsics_ = {220, 220, centre, centre};
  world_from_lamp_ = looking ({-0.6, 0.35, 1.3}, {0.6, -0.35, -1.5});
  lamp_from_world_ = world_from_lamp_.inverse ();
  scratch_.resize (std::size_t{kMapSize} * kMapSize);
  dark_.resize (scratch_.size ());
  rows_.resize (scratch_.size ());
}

void
ShadowMap::begin ()
{
  rasteriser_.begin (kMapSize, kMapSize);
}

void
ShadowMap::add (const std::vector<RasterVertex> &vertices, const Mesh &mesh)
{
  rasteriser_.draw (
      vertices, mesh, {scratch_.data (), kMapSize, kMapSize, kMapSize * sizeof (Rgbx)});
}

void
ShadowMap::end ()
{
  const auto smooth = [] (const float *from, std::ptrdiff_t step, int at) {
    float sum = 0;
    for (int k = -kRim; k <= kRim; k++)
      sum += from[step * std::clamp (at + k, 0, kMapSize - 1)];
    return sum / (2 * kRim + 1);
  };
  for (int y = 0; y < kMapSize; y++) {
    float row[kMapSize];
    for (int x = 0; x < kMapSize; x++)
      row[x] = rasteriser_.row (y)[x] > 0 ? 1.f : 0.f;
    for (int x = 0; x < kMapSize; x++)
      rows_[static_cast<std::size_t> (y) * kMapSize + x] = smooth (row, 1, x);
  }
  for (int y = 0; y < kMapSize; y++)
    for (int x = 0; x < kMapSize; x++)
      dark_[static_cast<std::size_t> (y) * kMapSize + x] = smooth (rows_.data () + x, kMapSize, y);
}

float
ShadowMap::at (Vec3 world) const
{
  const Vec3 p = lamp_from_world_ * world;
  if (p.z <= 0)
    return 0;
  const double x = intrinsics_.fx * p.x / p.z + intrinsics_.cx;
  const double y = intrinsics_.fy * p.y / p.z + intrinsics_.cy;
  if (!(x >= 0 && y >= 0 && x < kMapSize - 1 && y < kMapSize - 1))
    return 0;
  const int x0 = static_cast<int> (x), y0 = static_cast<int> (y);
  const auto fx = static_cast<float> (x - x0), fy = static_cast<float> (y - y0);
  const float *top = dark_.data () + static_cast<std::size_t> (y0) * kMapSize + x0;
  const float *low = top + kMapSize;
  return (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) + fy * ((1 - fx) * low[0] + fx * low[1]);
}

void
ShadowMap::darken (const Intrinsics &camera, const Pose &world_from_camera, const float *room,
    double strength, ImageView<Rgbx> colour) const
{
  /* The light in a shadow is a little bluer, as that of the sky. */
  const float tint[] = {1.f, 0.98f, 0.94f};
  for (int y = 0; y < colour.height; y++)
    for (int x = 0; x < colour.width; x++, room++) {
      const float dark = at (world_from_camera * camera.unproject (x, y, 1 / double (*room)));
      if (dark <= 0)
        continue;
      auto *channel = &colour.at (x, y).r;
      for (int c = 0; c < 3; c++)
        channel[c] = static_cast<std::uint8_t> (
            static_cast<float> (channel[c]) * (1 - static_cast<float> (strength) * dark * tint[c]) +
            0.5f);
    }
}

} // namespace rangecast
