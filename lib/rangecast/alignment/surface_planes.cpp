/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surface_planes.hpp"

#include <algorithm>
#include <cmath>

#include "../base/simd.hpp"

namespace rangecast {

namespace {

/* A plane passes through neighbours at a distance of focal length / kFocalPerReach pixels, so at
 * the same angle in all cameras. */
constexpr float kFocalPerReach = 200;
constexpr int kMinReach = 2, kMaxReach = 7;
constexpr float kMinCosine2 = 0.14f; ///< squared, of 68 degrees
/* How far depth may bend from one neighbour to the other, in pixel footprints for each pixel of the
 * distance. */
constexpr float kMaxBend = 1;

} // namespace

/* Branchless, so that compilers vectorize it. */
void
SurfacePlanes::make_row (const ConstRangeImage &image, int y, float focal_px)
{
  const std::uint16_t *middle = image.depth.row (y), *above = image.depth.row (y - reach_),
                      *below = image.depth.row (y + reach_);
  SurfacePlane *to = &planes_[static_cast<std::size_t> (y) * static_cast<std::size_t> (width_)];
  std::uint8_t *smooth = &smooth_[static_cast<std::size_t> (y) * static_cast<std::size_t> (width_)];
  const float focal2 = focal_px * focal_px,
              bend = kMaxBend * static_cast<float> (reach_) / focal_px,
              per_pixel = 0.5f / static_cast<float> (reach_);
  const int reach = reach_, end = width_ - reach_;
  for (int x = reach; x < end; x++) {
    const std::int32_t d = middle[x], l = middle[x - reach], r = middle[x + reach], a = above[x],
                       b = below[x];
    const std::int32_t nearest = std::min (std::min (std::min (l, r), std::min (a, b)), d);
    const auto depth = static_cast<float> (d);
    const float across = static_cast<float> (l - r) * per_pixel,
                down = static_cast<float> (a - b) * per_pixel;
    const auto bend_x = static_cast<float> (std::abs (l + r - 2 * d)),
               bend_y = static_cast<float> (std::abs (a + b - 2 * d));
    const float slope = (across * across + down * down) * focal2, depth2 = depth * depth;
    const float cosine2 = depth2 / (slope + depth2 + 1e-9f);
    const bool good = (nearest > 0) & (bend_x <= bend * depth) & (bend_y <= bend * depth) &
                      (cosine2 > kMinCosine2);
    to[x].depth = static_cast<float> (l + r + a + b + d) * 0.2f;
    to[x].across = across;
    to[x].down = down;
    to[x].weight = good ? (cosine2 - kMinCosine2) / (1 - kMinCosine2) : 0.f;
    smooth[x] = good ? 1 : 0;
  }
}

void
SurfacePlanes::fade_row (int y)
{
  const auto width = static_cast<std::size_t> (width_);
  const int fade = reach_ + 1, window = (2 * fade + 1) * (2 * fade + 1);
  /* A straight edge through the middle of the window leaves about half of it. */
  const int half = window / 2 + fade;
  std::uint8_t *sums = sums_.data ();
  std::fill_n (sums, width, std::uint8_t{0});
  for (int near = std::max (0, y - fade); near <= std::min (height_ - 1, y + fade); near++) {
    const std::uint8_t *smooth = &smooth_[static_cast<std::size_t> (near) * width];
    for (std::size_t x = 0; x < width; x++)
      sums[x] = static_cast<std::uint8_t> (sums[x] + smooth[x]);
  }
  SurfacePlane *to = &planes_[static_cast<std::size_t> (y) * width];
  const float scale = 1 / static_cast<float> (window - half);
  bool used = false;
  for (int x = fade; x < width_ - fade; x++) {
    int count = 0;
    for (int k = -fade; k <= fade; k++)
      count += sums[x + k];
    const int above = count > half ? count - half : 0;
    to[x].weight *= static_cast<float> (above) * scale;
    used |= above > 0;
  }
  used_[static_cast<std::size_t> (y)] = used;
  for (int x = 0; x < std::min (fade, width_); x++)
    to[x].weight = to[width_ - 1 - x].weight = 0;
}

void
SurfacePlanes::make (const ConstRangeImage &image, float focal_px)
{
  width_ = image.depth.width;
  height_ = image.depth.height;
  reach_ = std::clamp (static_cast<int> (focal_px / kFocalPerReach + 0.5f), kMinReach, kMaxReach);
  if (image.depth.empty ()) {
    width_ = height_ = 0;
    return;
  }
  const std::size_t width = static_cast<std::size_t> (width_),
                    size = width * static_cast<std::size_t> (height_);
  if (planes_.size () < size)
    planes_.resize (size);
  if (smooth_.size () < size)
    smooth_.resize (size);
  if (used_.size () < static_cast<std::size_t> (height_))
    used_.resize (static_cast<std::size_t> (height_));
  if (sums_.size () < width)
    sums_.resize (width);
  std::fill_n (smooth_.begin (), size, std::uint8_t{0});
  for_this_cpu ([&] {
    for (int y = 0; y < height_; y++)
      if (y >= reach_ && y < height_ - reach_ && width_ > 2 * reach_)
        make_row (image, y, focal_px);
      else
        std::fill_n (planes_.begin () + static_cast<std::ptrdiff_t> (y) * width_, width,
            SurfacePlane{0, 0, 0, 0});
    for (int y = 0; y < height_; y++)
      fade_row (y);
  });
}

} // namespace rangecast
