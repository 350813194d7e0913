/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "world_points.hpp"

#include <cstring>

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

/* Makes points of an image's valid pixels. */
template <typename L> struct FillLoop {
  using F = typename L::F;
  using I = typename L::I;

  const ConstRangeImage &image;
  const PixelRays &rays;
  float *x, *y, *z;
  std::uint32_t *pixel;

  static constexpr int kBlock = 16;
  typedef std::uint16_t Block __attribute__ ((vector_size (2 * kBlock), aligned (2), may_alias));
  typedef std::int16_t Mask __attribute__ ((vector_size (2 * kBlock)));

  /* Shortcuts for blocks: a person mostly fills a small part of a picture, with few holes. */
  static bool all_are (const Mask &mask)
  {
    std::uint64_t four[4];
    std::memcpy (four, &mask, sizeof four);
    return (four[0] & four[1] & four[2] & four[3]) == ~std::uint64_t{0};
  }

  /* Writes place and depth of the valid pixels of a row. @return how many */
  std::size_t compact_row (const std::uint16_t *depth, int width, std::uint32_t row,
      std::uint32_t *to, float *depths) const
  {
    std::size_t n = 0;
    const auto take = [&] (int u) {
      /* Always written, kept only if valid: a branch would be unpredictable at edges. At most
       * `width` elements are written, so this never leaves the part. */
      to[n] = row << 16 | static_cast<std::uint32_t> (u);
      depths[n] = depth[u];
      n += depth[u] != kInvalidDepth;
    };
    int u = 0;
    for (; u + kBlock <= width; u += kBlock) {
      const Mask invalid = *reinterpret_cast<const Block *> (depth + u) == kInvalidDepth;
      if (all_are (invalid))
        continue;
      if (all_are (~invalid)) {
        for (int k = 0; k < kBlock; k++) {
          to[n + k] = row << 16 | static_cast<std::uint32_t> (u + k);
          depths[n + k] = depth[u + k];
        }
        n += kBlock;
      } else {
        for (int k = 0; k < kBlock; k++)
          take (u + k);
      }
    }
    for (; u < width; u++)
      take (u);
    return n;
  }

  std::size_t run () const
  {
    std::size_t end = 0;
    for (int row = 0; row < image.depth.height && !image.depth.empty (); row++) {
      float *__restrict px = x + end, *__restrict py = y + end, *__restrict pz = z + end;
      const std::uint32_t *__restrict place = pixel + end;
      const std::size_t n = compact_row (image.depth.row (row), image.depth.width,
          static_cast<std::uint32_t> (row), pixel + end, px);
      const float v = static_cast<float> (image.roi.y + row), u0 = static_cast<float> (image.roi.x);
      float base[3];
      for (int k = 0; k < 3; k++)
        base[k] = rays.corner[k] + v * rays.down[k] + u0 * rays.right[k];
      std::size_t i = 0;
      for (; i + L::kLanes <= n; i += L::kLanes) {
        const F d = L::at (px + i);
        const F u = __builtin_convertvector((I)(L::at (place + i) & 0xffff), F);
        L::at (px + i) = rays.origin[0] + d * (base[0] + u * rays.right[0]);
        L::at (py + i) = rays.origin[1] + d * (base[1] + u * rays.right[1]);
        L::at (pz + i) = rays.origin[2] + d * (base[2] + u * rays.right[2]);
      }
      for (; i < n; i++) {
        const float d = px[i], u = static_cast<float> (static_cast<int> (place[i] & 0xffff));
        px[i] = rays.origin[0] + d * (base[0] + u * rays.right[0]);
        py[i] = rays.origin[1] + d * (base[1] + u * rays.right[1]);
        pz[i] = rays.origin[2] + d * (base[2] + u * rays.right[2]);
      }
      end += n;
    }
    return end;
  }
};

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
  const std::size_t begin = part.begin;
  float *px = x.data () + begin, *py = y.data () + begin, *pz = z.data () + begin;
  std::uint32_t *place = pixel.data () + begin;
  part.end = begin + for_this_cpu ([&]<typename L> (L) {
    return FillLoop<L>{image, rays, px, py, pz, place}.run ();
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
