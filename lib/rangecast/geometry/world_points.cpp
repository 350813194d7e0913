/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "world_points.hpp"

#include "../base/simd.hpp"

namespace rangecast {
namespace {

void
store (float *out, Vec3 v)
{
  out[0] = static_cast<float> (v.x);
  out[1] = static_cast<float> (v.y);
  out[2] = static_cast<float> (v.z);
}

/* Writes place and depth of the valid pixels of a row. @return how many */
std::size_t
compact_row (const std::uint16_t *depth, int width, int row, std::uint32_t *to, float *depths)
{
  std::size_t n = 0;
  for (int u = 0; u < width; u++) {
    /* Always written, kept only if valid: a branch would be unpredictable at edges. At most `width`
     * elements are written, so this never leaves the part. */
    to[n] = static_cast<std::uint32_t> (row) << 16 | static_cast<std::uint32_t> (u);
    depths[n] = depth[u];
    n += depth[u] != kInvalidDepth;
  }
  return n;
}

/* Makes points of a row's valid pixels, whose depths are in `x`. */
void
make_points (const PixelRays &pixel_rays, int column, int row, std::size_t n,
    const std::uint32_t *__restrict place, float *__restrict x, float *__restrict y,
    float *__restrict z)
{
  const PixelRays rays = pixel_rays; /* so that no store changes it */
  float base[3];
  for (int k = 0; k < 3; k++)
    base[k] = rays.corner[k] + static_cast<float> (row) * rays.down[k] +
              static_cast<float> (column) * rays.right[k];
  for (std::size_t i = 0; i < n; i++) {
    const float d = x[i], u = static_cast<float> (static_cast<int> (place[i] & 0xffff));
    x[i] = rays.origin[0] + d * (base[0] + u * rays.right[0]);
    y[i] = rays.origin[1] + d * (base[1] + u * rays.right[1]);
    z[i] = rays.origin[2] + d * (base[2] + u * rays.right[2]);
  }
}

} // namespace

PixelRays::PixelRays (const View &view)
{
  const Intrinsics &k = view.intrinsics;
  const Mat3 &r = view.world_from_view.rotation;
  const double unit = view.depth_unit_m;
  store (origin, view.world_from_view.translation);
  store (corner, unit * (r * k.unproject (0, 0, 1)));
  store (right, unit / k.fx * (r * Vec3{1, 0, 0}));
  store (down, unit / k.fy * (r * Vec3{0, 1, 0}));
  store (optical_axis, r * Vec3{0, 0, 1});
}

PixelLookup::PixelLookup (const View &view)
{
  const Intrinsics &k = view.intrinsics;
  const Mat3 r = transposed (view.world_from_view.rotation);
  const Vec3 t = r * view.world_from_view.translation;
  const double per_metre = 1 / view.depth_unit_m;
  for (int i = 0; i < 4; i++) {
    /* column i of view_from_world */
    const double x = i < 3 ? r[i] : -t.x, y = i < 3 ? r[3 + i] : -t.y, z = i < 3 ? r[6 + i] : -t.z;
    rows[0][i] = static_cast<float> ((k.fx * x + k.cx * z) * per_metre);
    rows[1][i] = static_cast<float> ((k.fy * y + k.cy * z) * per_metre);
    rows[2][i] = static_cast<float> (z * per_metre);
  }
}

Status
WorldPoints::reset (std::span<const RangeImage> images)
{
  std::size_t pixels = 0;
  parts_.clear ();
  for (const RangeImage &image : images) {
    parts_.push_back ({pixels, pixels});
    if (!image.depth.empty ())
      pixels += static_cast<std::size_t> (image.depth.width) * image.depth.height;
  }
  if (pixels > UINT32_MAX) {
    parts_.clear ();
    return {StatusCode::kBadSize,
        "frame set: " + std::to_string (pixels) + " pixels, which must be less than 2^32"};
  }
  if (pixel.size () < pixels) { /* the last to grow: all have grown */
    for (auto *array : {&x, &y, &z})
      array->resize (pixels);
    pixel.resize (pixels);
  }
  return {};
}

void
WorldPoints::fill (std::size_t index, const ConstRangeImage &image, const PixelRays &rays)
{
  Part &part = parts_[index];
  part.end = part.begin;
  if (image.depth.empty ())
    return;
  for_this_cpu ([&] {
    for (int row = 0; row < image.depth.height; row++) {
      float *const px = x.data () + part.end;
      std::uint32_t *const place = pixel.data () + part.end;
      const std::size_t n = compact_row (image.depth.row (row), image.depth.width, row, place, px);
      make_points (rays, image.roi.x, image.roi.y + row, n, place, px, y.data () + part.end,
          z.data () + part.end);
      part.end += n;
    }
  });
}

std::size_t
WorldPoints::size () const
{
  std::size_t n = 0;
  for (const Part &part : parts_)
    n += part.size ();
  return n;
}

} // namespace rangecast
