/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Edge functions after Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH 1988. */
#include "rasteriser.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr int kSubpixels = 256;
/* Corners farther out than this do not fit the fixed-point arithmetic (64 bit products). */
constexpr float kMaxPosition = 1 << 20;

} // namespace

/** A quantity that is linear in the picture: at (x0 + x, y0 + y) it is base + dx * x + dy * y. The
 *  origin (x0, y0) is near the triangle, so that small differences keep their digits. */
struct Rasteriser::Plane {
  float base, dx, dy;

  Plane (const RasterVertex &a, const RasterVertex &b, const RasterVertex &c, float inverse_area,
      float qa, float qb, float qc, int x0, int y0)
  {
    const float ab = qb - qa, ac = qc - qa;
    dx = (ab * (c.y - a.y) - ac * (b.y - a.y)) * inverse_area;
    dy = (ac * (b.x - a.x) - ab * (c.x - a.x)) * inverse_area;
    base = qa + dx * (static_cast<float> (x0) - a.x) + dy * (static_cast<float> (y0) - a.y);
  }
};

/** A corner with the light of the side that is seen. */
struct Rasteriser::Corner : RasterVertex {
  Rgbx tint; ///< the vertex's own colour
};

namespace {

inline Rgbx
sample (ImageView<const Rgbx> level, float u, float v, float light)
{
  const float x = std::clamp (
      u * static_cast<float> (level.width) - 0.5f, 0.0f, static_cast<float> (level.width - 1));
  const float y = std::clamp (
      v * static_cast<float> (level.height) - 0.5f, 0.0f, static_cast<float> (level.height - 1));
  const int x0 = static_cast<int> (x), y0 = static_cast<int> (y);
  const int step = x0 + 1 < level.width;
  const float fx = x - static_cast<float> (x0), fy = y - static_cast<float> (y0);
  const Rgbx *top = level.row (y0) + x0;
  const Rgbx *low = level.row (std::min (y0 + 1, level.height - 1)) + x0;
  const float w11 = fx * fy * light, w01 = fx * light - w11, w10 = fy * light - w11,
              w00 = light - w01 - w10 - w11;
  const auto blend = [&] (std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
    return static_cast<std::uint8_t> (w00 * a + w01 * b + w10 * c + w11 * d + 0.5f);
  };
  return {blend (top[0].r, top[step].r, low[0].r, low[step].r),
      blend (top[0].g, top[step].g, low[0].g, low[step].g),
      blend (top[0].b, top[step].b, low[0].b, low[step].b), 0};
}

inline int
wrapped (int i, int size, TextureWrap wrap)
{
  if (wrap == TextureWrap::kClamp)
    return std::clamp (i, 0, size - 1);
  const int period = wrap == TextureWrap::kRepeat ? size : 2 * size;
  const int at = (i % period + period) % period;
  return at < size ? at : 2 * size - 1 - at;
}

/** Any wrap, with alpha in x. @param light  of R, G, B */
Rgbx
sample_wrapped (
    ImageView<const Rgbx> level, float u, float v, const float (&light)[3], const Mesh &mesh)
{
  const auto bounded = [] (float at) { return std::abs (at) < 1e9f ? at : 0; }; /* and not NaN */
  const float x = bounded (u * static_cast<float> (level.width) - 0.5f),
              y = bounded (v * static_cast<float> (level.height) - 0.5f);
  const float left = std::floor (x), top = std::floor (y), fx = x - left, fy = y - top;
  const int x0 = wrapped (static_cast<int> (left), level.width, mesh.wrap_u),
            x1 = wrapped (static_cast<int> (left) + 1, level.width, mesh.wrap_u);
  const Rgbx *upper = level.row (wrapped (static_cast<int> (top), level.height, mesh.wrap_v)),
             *lower = level.row (wrapped (static_cast<int> (top) + 1, level.height, mesh.wrap_v));
  const auto blend = [&] (std::uint8_t Rgbx::*c, float factor) {
    const float above = upper[x0].*c + fx * static_cast<float> (upper[x1].*c - upper[x0].*c),
                below = lower[x0].*c + fx * static_cast<float> (lower[x1].*c - lower[x0].*c);
    return static_cast<std::uint8_t> (factor * (above + fy * (below - above)) + 0.5f);
  };
  return {blend (&Rgbx::r, light[0]), blend (&Rgbx::g, light[1]), blend (&Rgbx::b, light[2]),
      blend (&Rgbx::x, 1)};
}

/** The mip level whose texels are about as large as pixels. */
int
level_for (const RasterVertex &a, const RasterVertex &b, const RasterVertex &c, float area,
    const MipMap &texture)
{
  const ImageView<const Rgbx> full = texture.level (0);
  const float texels = std::abs ((b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v)) *
                       static_cast<float> (full.width) * static_cast<float> (full.height);
  if (!(texels > area))
    return 0;
  const auto last = static_cast<float> (texture.levels () - 1);
  return static_cast<int> (std::min (0.5f * std::log2 (texels / area) + 0.5f, last));
}

} // namespace

void
Rasteriser::begin (int width, int height, const std::vector<float> &inverse_depth)
{
  width_ = width;
  height_ = height;
  inverse_depth_ = inverse_depth;
}

/** @tparam kPlain  a texture without wrap and alpha, and no colours of vertices */
template <bool kPlain>
void
Rasteriser::triangle (
    const Corner &a, const Corner &b, const Corner &c, const Mesh &mesh, ImageView<Rgbx> colour)
{
  using std::int64_t;
  const int64_t ax = std::lrint (a.x * kSubpixels), ay = std::lrint (a.y * kSubpixels);
  const int64_t bx = std::lrint (b.x * kSubpixels), by = std::lrint (b.y * kSubpixels);
  const int64_t cx = std::lrint (c.x * kSubpixels), cy = std::lrint (c.y * kSubpixels);
  const auto first = [] (int64_t lowest) { return (lowest + kSubpixels - 1) >> 8; };
  const int x0 = static_cast<int> (std::max<int64_t> (0, first (std::min ({ax, bx, cx}))));
  const int y0 = static_cast<int> (std::max<int64_t> (0, first (std::min ({ay, by, cy}))));
  const int x1 = static_cast<int> (std::min<int64_t> (width_ - 1, std::max ({ax, bx, cx}) >> 8));
  const int y1 = static_cast<int> (std::min<int64_t> (height_ - 1, std::max ({ay, by, cy}) >> 8));
  if (x0 > x1 || y0 > y1)
    return; /* between pixel centres: most of the small ones end here */

  const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  if (std::abs (area) < 1e-9f)
    return;
  const float k = 1 / area;
  const auto plane = [&] (float qa, float qb, float qc) {
    return Plane (a, b, c, k, qa, qb, qc, x0, y0);
  };
  const Plane w = plane (a.inverse_depth, b.inverse_depth, c.inverse_depth),
              u = plane (a.u * a.inverse_depth, b.u * b.inverse_depth, c.u * c.inverse_depth),
              v = plane (a.v * a.inverse_depth, b.v * b.inverse_depth, c.v * c.inverse_depth),
              l = plane (a.light, b.light, c.light);
  const MipMap &texture = *mesh.texture;
  const ImageView<const Rgbx> level = texture.level (level_for (a, b, c, std::abs (area), texture));
  const auto tinted = [&] (std::uint8_t Rgbx::*channel) {
    const auto at = [channel] (const Corner &corner) {
      return corner.light * static_cast<float> (corner.tint.*channel) / 255;
    };
    return plane (at (a), at (b), at (c));
  };
  const Plane tint[] = {kPlain ? l : tinted (&Rgbx::r), kPlain ? l : tinted (&Rgbx::g),
      kPlain ? l : tinted (&Rgbx::b)};

  /* Inside means on the same side of all edges (front faces have negative area: y points down; of
   * others two corners were exchanged). */
  const auto edge = [] (int64_t px, int64_t py, int64_t qx, int64_t qy, int64_t x, int64_t y) {
    return (qy - py) * (x - px) - (qx - px) * (y - py);
  };
  const int64_t sx = int64_t (x0) * kSubpixels, sy = int64_t (y0) * kSubpixels;
  int64_t e0 = edge (ax, ay, bx, by, sx, sy), e1 = edge (bx, by, cx, cy, sx, sy),
          e2 = edge (cx, cy, ax, ay, sx, sy);
  for (int y = y0; y <= y1; y++) {
    float *depth = inverse_depth_.data () + static_cast<std::size_t> (y) * width_;
    Rgbx *out = colour.row (y);
    int64_t f0 = e0, f1 = e1, f2 = e2;
    for (int x = x0; x <= x1; x++) {
      if ((f0 | f1 | f2) >= 0) {
        const auto i = static_cast<float> (x - x0), j = static_cast<float> (y - y0);
        const float inverse = w.base + w.dx * i + w.dy * j;
        if (inverse > depth[x]) {
          const float z = 1 / inverse;
          const float tu = (u.base + u.dx * i + u.dy * j) * z,
                      tv = (v.base + v.dx * i + v.dy * j) * z;
          const auto light_at = [i, j] (const Plane &p) {
            return std::clamp (p.base + p.dx * i + p.dy * j, 0.0f, 1.0f);
          };
          if constexpr (kPlain) {
            depth[x] = inverse;
            out[x] = sample (level, tu, tv, light_at (l));
          } else {
            const float light[] = {light_at (tint[0]), light_at (tint[1]), light_at (tint[2])};
            const Rgbx pixel = sample_wrapped (level, tu, tv, light, mesh);
            if (pixel.x >= mesh.alpha_cutoff) {
              depth[x] = inverse;
              out[x] = {pixel.r, pixel.g, pixel.b, 0};
            }
          }
        }
      }
      f0 += (by - ay) * kSubpixels;
      f1 += (cy - by) * kSubpixels;
      f2 += (ay - cy) * kSubpixels;
    }
    e0 -= (bx - ax) * kSubpixels;
    e1 -= (cx - bx) * kSubpixels;
    e2 -= (ax - cx) * kSubpixels;
  }
}

void
Rasteriser::draw (
    const std::vector<RasterVertex> &vertices, const Mesh &mesh, ImageView<Rgbx> colour)
{
  const auto usable = [] (const RasterVertex &v) {
    return v.inverse_depth > 0 && std::abs (v.x) < kMaxPosition && std::abs (v.y) < kMaxPosition;
  };
  const bool plain = mesh.colours.empty () && mesh.alpha_cutoff == 0 &&
                     mesh.wrap_u == TextureWrap::kClamp && mesh.wrap_v == TextureWrap::kClamp;
  for (const auto &t : mesh.triangles) {
    const RasterVertex &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
    /* Counter-clockwise from outside is negative here, because y points down. */
    const bool front = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y) < 0;
    if ((!front && !mesh.double_sided) || !usable (a) || !usable (b) || !usable (c))
      continue;
    const auto corner = [&] (std::uint32_t i) {
      Corner made{vertices[i], mesh.colours.empty () ? Rgbx{255, 255, 255, 255} : mesh.colours[i]};
      if (!front)
        made.light = made.back_light;
      return made;
    };
    const Corner second = corner (front ? t[1] : t[2]), third = corner (front ? t[2] : t[1]);
    if (plain)
      triangle<true> (corner (t[0]), second, third, mesh, colour);
    else
      triangle<false> (corner (t[0]), second, third, mesh, colour);
  }
}

} // namespace rangecast
