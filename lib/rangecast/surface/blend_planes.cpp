/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blend_planes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* Chamfer distances: 3 for a step to the side, 4 for a diagonal one (G. Borgefors, "Distance
 * transformations in digital images", CVGIP 34, 1986). */
constexpr int kSide = 3, kDiagonal = 4;
constexpr int kMaxDistance = kSide * kFeatherPixels;

/* A view sees through a point if it sees something farther by this, metres. */
constexpr double kClearance = 0.01;
/* A view sees the background at an invalid pixel if there is no valid one this near: matching
 * leaves holes in surfaces, too. */
constexpr int kBackgroundRadius = 1;

/* Copies of the neighbour code may be off by its threshold, 5 levels of R, G and B each by default.
 */
constexpr int kCopyRange = 7, kCopyReach = 2;

class PlaneBuilder {
public:
  PlaneBuilder (
      std::span<const SurfaceView> views, std::size_t which, double depth_step, BlendPlanes &to)
      : views_ (views), which_ (which), image_ (views[which].image), view_ (*views[which].view),
        depth_step_ (static_cast<float> (depth_step)),
        steep_ (static_cast<float> (kSteepSlope / view_.intrinsics.fx)), to_ (to),
        width_ (image_.depth.width), height_ (image_.depth.height)
  {
    to.width = width_;
    to.height = height_;
    const auto size = static_cast<std::size_t> (width_) * static_cast<std::size_t> (height_);
    to.colour.resize (size);
    to.weight.resize (size);
    to.copied.resize (size);
  }

  template <typename L> void make (const L &)
  {
    if (image_.depth.empty ())
      return;
    for (int y = 0; y < height_; y++)
      join_row (y);
    for (int y = 0; y < height_; y++)
      begin_distances (y);
    measure_distances ();
    smooth_copies<L> ();
    for (int y = 0; y < height_; y++)
      weigh_row (y);
  }

private:
  [[nodiscard]] std::size_t place (int x, int y) const
  {
    return static_cast<std::size_t> (y) * static_cast<std::size_t> (width_) +
           static_cast<std::size_t> (x);
  }
  [[nodiscard]] bool has (int x, int y, std::uint8_t flags) const
  {
    return (to_.colour[place (x, y)].x & flags) == flags;
  }

  [[nodiscard]] Vec3 world_of (int x, int y, double depth) const
  {
    return view_.world_from_view * view_.intrinsics.unproject (x + image_.roi.x, y + image_.roi.y,
                                       depth * view_.depth_unit_m);
  }

  /* Whether another view sees something farther, or the background, in the direction of a point. */
  [[nodiscard]] bool is_seen_through (const Vec3 &point) const
  {
    for (std::size_t i = 0; i < views_.size (); i++)
      if (i != which_ && sees_through (views_[i], point))
        return true;
    return false;
  }

  [[nodiscard]] static bool sees_through (const SurfaceView &other, const Vec3 &point)
  {
    const View &view = *other.view;
    const Vec3 from = point - view.world_from_view.translation;
    const Mat3 &r = view.world_from_view.rotation;
    const double z = dot (from, {r[2], r[5], r[8]});
    if (z <= view.near_m || z >= view.far_m || other.image.roi.empty ())
      return false;
    const double u = view.intrinsics.fx * dot (from, {r[0], r[3], r[6]}) / z + view.intrinsics.cx,
                 v = view.intrinsics.fy * dot (from, {r[1], r[4], r[7]}) / z + view.intrinsics.cy;
    if (!(u > 0 && v > 0 && u < view.width - 1 && v < view.height - 1))
      return false;
    const Roi &roi = other.image.roi;
    const int x = static_cast<int> (u + 0.5) - roi.x, y = static_cast<int> (v + 0.5) - roi.y;
    if (x >= 0 && y >= 0 && x < roi.width && y < roi.height)
      if (const std::uint16_t depth = other.image.depth.at (x, y); depth != kInvalidDepth)
        return depth * view.depth_unit_m > z + kClearance;
    for (int b = std::max (y - kBackgroundRadius, 0);
         b <= std::min (y + kBackgroundRadius, roi.height - 1); b++)
      for (int a = std::max (x - kBackgroundRadius, 0);
           a <= std::min (x + kBackgroundRadius, roi.width - 1); a++)
        if (other.image.depth.at (a, b) != kInvalidDepth)
          return false;
    return true;
  }

  [[nodiscard]] bool joins (int x, int y, int u, int v) const
  {
    const int a = image_.depth.at (x, y), b = image_.depth.at (u, v);
    const auto step = static_cast<float> (std::abs (a - b)),
               min = static_cast<float> (std::min (a, b));
    if (b == kInvalidDepth || step > depth_step_ * min)
      return false;
    return step <= steep_ * min ||
           !is_seen_through (0.5 * (world_of (x, y, a) + world_of (u, v, b)));
  }

  void join_row (int y)
  {
    for (int x = 0; x < width_; x++) {
      Rgbx &colour = to_.colour[place (x, y)];
      colour = image_.colour.at (x, y);
      colour.x = 0;
      if (image_.depth.at (x, y) == kInvalidDepth)
        continue;
      colour.x = kValid;
      if (x + 1 < width_ && joins (x, y, x + 1, y))
        colour.x |= kJoinsRight;
      if (y + 1 < height_ && joins (x, y, x, y + 1))
        colour.x |= kJoinsBelow;
    }
  }

  /* Initial distances: one step for pixels at a depth edge. */
  void begin_distances (int y)
  {
    for (int x = 0; x < width_; x++) {
      const bool inside = x > 0 && y > 0 && has (x, y, kValid | kJoinsRight | kJoinsBelow) &&
                          has (x - 1, y, kJoinsRight) && has (x, y - 1, kJoinsBelow);
      to_.weight[place (x, y)] = static_cast<std::uint8_t> (inside               ? kMaxDistance
                                                            : has (x, y, kValid) ? kSide
                                                                                 : 0);
    }
  }

  /* Pixels at the border of the image are at an edge already. */
  void measure_distances ()
  {
    const auto sweep = [this] (int x, int y, int way) {
      std::uint8_t *at = &to_.weight[place (x, y)];
      const std::ptrdiff_t row = way * width_;
      const int min = std::min (
          std::min (at[way], at[row]) + kSide, std::min (at[row - 1], at[row + 1]) + kDiagonal);
      *at = static_cast<std::uint8_t> (std::min<int> (*at, min));
    };
    for (int y = 1; y + 1 < height_; y++)
      for (int x = 1; x + 1 < width_; x++)
        sweep (x, y, -1);
    for (int y = height_ - 2; y > 0; y--)
      for (int x = width_ - 2; x > 0; x--)
        sweep (x, y, 1);
  }

  /* Replaces copied pixels by the mean of the surrounding pixels within the code's threshold,
   * first along rows, then along columns. */
  template <typename L> void smooth_copies ()
  {
    bool any = false;
    for (int y = 0; y < height_; y++)
      any = find_copies (y) || any;
    if (!any)
      return;
    smooth<L> (false);
    smooth<L> (true);
  }

  /* Finds pixels that equal the left, upper-left, upper or upper-right one. @return whether any
   * does */
  bool find_copies (int y)
  {
    std::uint8_t *copied = &to_.copied[place (0, y)];
    const std::uint16_t *depth = image_.depth.row (y);
    const Rgbx *colour = image_.colour.row (y);
    const std::uint16_t *depth_above = y > 0 ? image_.depth.row (y - 1) : depth;
    const Rgbx *above = y > 0 ? image_.colour.row (y - 1) : colour;
    const bool has_above = y > 0;
    const auto equals = [&] (int x, const std::uint16_t *d, const Rgbx *c, int u) {
      return (depth[x] == d[u]) & (colour[x].r == c[u].r) & (colour[x].g == c[u].g) &
             (colour[x].b == c[u].b);
    };
    const auto is_copy = [&] (int x, bool left, bool right) {
      bool is = left && equals (x, depth, colour, x - 1);
      if (has_above)
        is = is | equals (x, depth_above, above, x) |
             (left && equals (x, depth_above, above, x - 1)) |
             (right && equals (x, depth_above, above, x + 1));
      return static_cast<std::uint8_t> (is & (depth[x] != kInvalidDepth));
    };
    if (width_ == 1) {
      copied[0] = is_copy (0, false, false);
      return copied[0] != 0;
    }
    copied[0] = is_copy (0, false, true);
    for (int x = 1; x < width_ - 1; x++)
      copied[x] = is_copy (x, true, true);
    copied[width_ - 1] = is_copy (width_ - 1, true, false);
    int sum = 0;
    for (int x = 0; x < width_; x++)
      sum |= copied[x];
    return sum != 0;
  }

  template <typename L> void smooth (bool down)
  {
    constexpr std::size_t kSpace = kMaxLanes + kCopyReach; /* lanes may go beyond the planes */
    to_.scratch.resize (to_.colour.size () + 2 * kSpace);
    std::ranges::copy (to_.colour, to_.scratch.begin () + kSpace);
    for (int y = 0; y < height_; y++)
      for (int x = 0; x < width_; x += L::kLanes)
        smooth_pixels<L> (x, y, &to_.scratch[kSpace + place (x, y)], down);
  }

  /* @param from  in scratch: the colours before this pass, at (x, y) */
  template <typename L> void smooth_pixels (int x, int y, const Rgbx *from, bool down)
  {
    using I = typename L::I;
    const std::uint8_t *copied = &to_.copied[place (x, y)];
    const int count = std::min (L::kLanes, width_ - x);
    I lane, is_copy;
    for (int l = 0; l < L::kLanes; l++)
      lane[l] = x + l, is_copy[l] = l < count && copied[l] ? -1 : 0;
    if (!L::any (is_copy))
      return;
    const auto pixels = [from] (std::ptrdiff_t by) -> I {
      return L::at (reinterpret_cast<const std::int32_t *> (from + by));
    };
    const I own = pixels (0);
    I n{}, r{}, g{}, b{};
    for (int k = -kCopyReach; k <= kCopyReach; k++) {
      if (down && (y + k < 0 || y + k >= height_))
        continue;
      const I other = pixels (k * (down ? width_ : 1)), at = lane + (down ? 0 : k);
      I same = ((other & kValid << 24) != 0) & (at >= 0) & (at < width_);
      for (int c = 0; c < 24; c += 8) {
        const I step = (other >> c & 255) - (own >> c & 255);
        same &= (step <= kCopyRange) & (step >= -kCopyRange);
      }
      const I counted = other & same;
      n -= same, r += counted & 255, g += counted >> 8 & 255, b += counted >> 16 & 255;
    }
    const auto mean = [&n] (const I &sum) -> I { /* the integer part is exact in floats */
      using F = typename L::F;
      return __builtin_convertvector(
          __builtin_convertvector(sum + n / 2, F) / __builtin_convertvector(n, F), I);
    };
    const I means = mean (r) | mean (g) << 8 | mean (b) << 16 | (own & 0xff << 24);
    Rgbx *to = &to_.colour[place (x, y)];
    for (int l = 0; l < count; l++)
      if (is_copy[l])
        to[l] = std::bit_cast<Rgbx> (means[l]);
  }

  /* From a pixel to its two neighbours along one axis. */
  struct Steps {
    int before, after;         /* of the depth */
    int has_before, has_after; /* 1: joined */
  };
  /* Change of depth from one pixel to the next: the mean of both sides, or the steeper step if that
   * is steep. */
  [[nodiscard]] float slope (Steps s, float steep_share) const
  {
    const int before = s.has_before * s.before, after = s.has_after * s.after;
    const float mean = static_cast<float> (before + after) *
                       (1 - 0.5f * static_cast<float> (s.has_before & s.has_after));
    const int steeper = std::abs (before) > std::abs (after) ? before : after;
    const float steepness = 2 * static_cast<float> (std::abs (steeper)) * steep_share - 1;
    const float share = steepness > 1 ? 1 : steepness, part = share > 0 ? share : 0;
    return mean + part * (static_cast<float> (steeper) - mean);
  }

  /* The square root of the weight: of the distance to the edge times the squared cosine between the
   * surface's normal and the ray to the camera. */
  void weigh_row (int y)
  {
    const std::uint16_t *depth = image_.depth.row (y);
    const std::uint16_t *above = y > 0 ? image_.depth.row (y - 1) : depth,
                        *below = y + 1 < height_ ? image_.depth.row (y + 1) : depth;
    const Rgbx *flags = &to_.colour[place (0, y)], *flags_above = y > 0 ? flags - width_ : flags;
    const int upper = y > 0 ? 1 : 0;
    std::uint8_t *__restrict weight = &to_.weight[place (0, y)];
    const int width = width_;
    const Intrinsics &lens = view_.intrinsics;
    const auto fx = static_cast<float> (lens.fx), fy = static_cast<float> (lens.fy),
               across = static_cast<float> (image_.roi.x - lens.cx),
               v = static_cast<float> (y + image_.roi.y - lens.cy);
    const float fx2 = 1 / (fx * fx), ray_y = 1 + v * v / (fy * fy), steep = 1 / steep_;
    const auto weigh = [&] (int x, int left, int right) {
      const float z = depth[x], steep_share = steep / (z + 1e-3f);
      const int here = flags[x].x;
      const float gx = slope (
                      {depth[x] - depth[x - left], depth[x + right] - depth[x],
                          left * (flags[x - left].x / kJoinsRight & 1), here / kJoinsRight & 1},
                      steep_share),
                  gy = slope (
                      {depth[x] - above[x], below[x] - depth[x],
                          upper * (flags_above[x].x / kJoinsBelow & 1), here / kJoinsBelow & 1},
                      steep_share);
      const float u = static_cast<float> (x) + across;
      const float nx = fx * gx, ny = fy * gy, nz = z + u * gx + v * gy;
      const float ray = ray_y + u * u * fx2;
      const float squared = z * z / ((nx * nx + ny * ny + nz * nz) * ray + 1e-6f);
      const int distance = weight[x];
      const float share = static_cast<float> (distance) * (1.f / kMaxDistance);
      const auto root = static_cast<int> (255 * std::sqrt (share * squared) + 0.5f);
      const int min = distance > 0 ? 1 : 0, max = root > 255 ? 255 : root;
      weight[x] = static_cast<std::uint8_t> (max > min ? max : min);
    };
    weigh (0, 0, width > 1 ? 1 : 0);
    for (int x = 1; x < width - 1; x++)
      weigh (x, 1, 1);
    if (width > 1)
      weigh (width - 1, 1, 0);
  }

  const std::span<const SurfaceView> views_;
  const std::size_t which_;
  const ConstRangeImage &image_;
  const View &view_;
  const float depth_step_, steep_; /* shares of the depth */
  BlendPlanes &to_;
  const int width_, height_;
};

} // namespace

void
make_blend_planes (
    std::span<const SurfaceView> views, std::size_t which, double depth_step, BlendPlanes &to)
{
  for_this_cpu ([&] (auto lanes) { PlaneBuilder (views, which, depth_step, to).make (lanes); });
}

} // namespace rangecast
