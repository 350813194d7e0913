/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Edge functions after Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH 1988. */
#include "rasteriser.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {

static constexpr int kSubpixels = 256;
/* Corners farther out than this do not fit the fixed-point arithmetic (64 bit products). */
static constexpr float kFarthest = 1 << 20;

/** A quantity that is linear in the picture: at (x, y) it is base + dx * x + dy * y. */
struct Rasteriser::Plane {
  float base, dx, dy;

  Plane (const RasterVertex &a, const RasterVertex &b, const RasterVertex &c, float inverse_area,
      float qa, float qb, float qc)
  {
    const float ab = qb - qa, ac = qc - qa;
    dx = (ab * (c.y - a.y) - ac * (b.y - a.y)) * inverse_area;
    dy = (ac * (b.x - a.x) - ab * (c.x - a.x)) * inverse_area;
    base = qa - dx * a.x - dy * a.y;
  }
  /** Moves the origin to a corner, where small differences keep their digits. */
  void rebase (const RasterVertex &a, float qa, int x, int y)
  {
    base = qa + dx * (static_cast<float> (x) - a.x) + dy * (static_cast<float> (y) - a.y);
  }
};

static inline Rgbx
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

void
Rasteriser::begin (int width, int height)
{
  width_ = width;
  height_ = height;
  inverse_depth_.assign (static_cast<std::size_t> (width) * height, 0);
}

void
Rasteriser::begin (int width, int height, const std::vector<float> &inverse_depth)
{
  width_ = width;
  height_ = height;
  inverse_depth_ = inverse_depth;
}

/** The mip level whose texels are about as large as pixels. */
static int
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

void
Rasteriser::triangle (const RasterVertex &a, const RasterVertex &b, const RasterVertex &c,
    const MipMap &texture, ImageView<Rgbx> colour)
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
  Plane w (a, b, c, k, a.inverse_depth, b.inverse_depth, c.inverse_depth);
  Plane u (a, b, c, k, a.u * a.inverse_depth, b.u * b.inverse_depth, c.u * c.inverse_depth);
  Plane v (a, b, c, k, a.v * a.inverse_depth, b.v * b.inverse_depth, c.v * c.inverse_depth);
  Plane l (a, b, c, k, a.light, b.light, c.light);
  w.rebase (a, a.inverse_depth, x0, y0);
  u.rebase (a, a.u * a.inverse_depth, x0, y0);
  v.rebase (a, a.v * a.inverse_depth, x0, y0);
  l.rebase (a, a.light, x0, y0);
  const ImageView<const Rgbx> level = texture.level (level_for (a, b, c, std::abs (area), texture));

  /* Inside means on the same side of all edges (front faces have negative area: y points down). */
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
          depth[x] = inverse;
          const float z = 1 / inverse;
          out[x] =
              sample (level, (u.base + u.dx * i + u.dy * j) * z, (v.base + v.dx * i + v.dy * j) * z,
                  std::clamp (l.base + l.dx * i + l.dy * j, 0.0f, 1.0f));
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
Rasteriser::draw (const std::vector<RasterVertex> &vertices,
    const std::vector<std::array<std::uint32_t, 3>> &triangles, const MipMap &texture,
    ImageView<Rgbx> colour)
{
  const auto usable = [] (const RasterVertex &v) {
    return v.inverse_depth > 0 && std::abs (v.x) < kFarthest && std::abs (v.y) < kFarthest;
  };
  for (const auto &t : triangles) {
    const RasterVertex &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
    /* Counter-clockwise from outside is negative here, because y points down. */
    if ((b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y) < 0 && usable (a) && usable (b) &&
        usable (c))
      triangle (a, b, c, texture, colour);
  }
}

} // namespace rangecast
