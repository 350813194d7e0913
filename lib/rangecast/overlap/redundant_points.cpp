/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "redundant_points.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "../base/parallel.hpp"
#include "../geometry/pixel_transfer.hpp"

namespace rangecast {
namespace {

/* Neighbours whose depths differ by more than this share are not joined; as striprender's
 * depth-step. */
constexpr float kDepthStep = 0.03f;
/* Maximum distance of a point from a surface that it lies on, in footprints of that view's pixels
 * along the surface. 0 would do for exact depth; two opened half more holes. */
constexpr float kTolerance = 1;
/* A place this near a pixel is that pixel, so that the outline of one view ends at another's. */
constexpr float kSnap = 1.f / 32;

float
snapped (float place)
{
  const float pixel = std::floor (place + 0.5f);
  return std::abs (place - pixel) < kSnap ? pixel : place;
}

void
make_surface (const RangeImage &image, std::uint8_t *to)
{
  constexpr auto kStep = static_cast<std::uint32_t> (kDepthStep * 65536);
  for (int y = 0; y + 1 < image.depth.height; y++, to += image.depth.width) {
    const std::uint16_t *upper = image.depth.row (y), *lower = image.depth.row (y + 1);
    for (int x = 0; x + 1 < image.depth.width; x++) {
      const std::uint32_t nearest = std::min (
                              std::min (upper[x], upper[x + 1]), std::min (lower[x], lower[x + 1])),
                          farthest = std::max (
                              std::max (upper[x], upper[x + 1]), std::max (lower[x], lower[x + 1]));
      to[x] = nearest != kInvalidDepth && farthest - nearest <= nearest * kStep >> 16;
    }
  }
}

} // namespace

void
RedundantPoints::BytePlane::reset (const RangeImage &image, std::uint8_t value)
{
  width = static_cast<std::size_t> (image.depth.width);
  const std::size_t size = width * static_cast<std::size_t> (image.depth.height);
  if (bytes.size () < size)
    bytes.resize (size);
  std::fill_n (bytes.begin (), size, value);
}

/* Whether images that won pixels of one image cover these. */
struct RedundantPoints::Comparison {
  RedundantPoints &owner;
  const DecidedFrame &frame;
  std::size_t own;
  float overlap;
  const ImageView<std::uint16_t> &depth;
  /* To each winner's plane, and the size of its pixels at depth 1, in depth units. */
  std::array<PixelTransfer, kMaxViews> transfers;
  std::array<float, kMaxViews> footprints{};

  Comparison (RedundantPoints &points, const DecidedFrame &decided, std::size_t image, float reach)
      : owner (points), frame (decided), own (image), overlap (reach),
        depth (decided.images[image].depth)
  {
    const auto length = [] (const float *v) { return std::hypot (v[0], v[1], v[2]); };
    for (std::uint64_t rest = owner.images_[own].winners; rest; rest &= rest - 1) {
      const auto w = static_cast<std::size_t> (std::countr_zero (rest));
      transfers[w] = PixelTransfer (
          frame.rays[own], frame.images[own].roi, frame.lookups[w], frame.images[w].roi);
      footprints[w] = length (frame.rays[w].right) * length (frame.lookups[w].rows[2]);
    }
    const std::size_t pixels =
        static_cast<std::size_t> (depth.width) * static_cast<std::size_t> (depth.height);
    std::fill_n (owner.places_.begin (), pixels, Place{0, 0, kNoWinner, false});
  }

  /* Whether a point that a winner sees at u, v, z lies on the surface of the four pixels around. */
  [[nodiscard]] bool is_on_surface (std::uint8_t winner, float u, float v, float z) const
  {
    const ImageView<std::uint16_t> &other = frame.images[winner].depth;
    const int left = static_cast<int> (u), top = static_cast<int> (v);
    const float right_share = u - static_cast<float> (left),
                down_share = v - static_cast<float> (top);
    const std::uint16_t *upper = other.row (top) + left,
                        *lower = other.row (top + (down_share > 0)) + left;
    const int beside = right_share > 0;
    const float a = upper[0], b = upper[beside], c = lower[0], d = lower[beside];
    const float above = a + right_share * (b - a), below = c + right_share * (d - c);
    const auto [nearest, farthest] = std::minmax ({a, b, c, d});
    return nearest > 0 && std::abs (z - (above + down_share * (below - above))) <=
                              kTolerance * (z * footprints[winner] + (farthest - nearest));
  }

  const Place &place_of (int x, int y, std::uint8_t winner)
  {
    Place &place = owner.places_[static_cast<std::size_t> (y * depth.width + x)];
    if (place.winner == winner)
      return place;
    float h[3];
    transfers[winner].find (x, y, depth.at (x, y), h);
    const float u = snapped (h[0] / h[2]), v = snapped (h[1] / h[2]);
    const ImageView<std::uint16_t> &other = frame.images[winner].depth;
    const bool seen = h[2] > 0 && u >= 0 && v >= 0 && u <= static_cast<float> (other.width - 1) &&
                      v <= static_cast<float> (other.height - 1);
    place = {u, v, winner, seen && is_on_surface (winner, u, v, h[2])};
    return place;
  }

  /* Whether the winner has a closed surface between these places, and one pixel further each way.
   */
  [[nodiscard]] bool is_closed (
      std::uint8_t winner, float left, float right, float top, float bottom) const
  {
    const ImageView<std::uint16_t> &other = frame.images[winner].depth;
    if (!(left >= 0 && top >= 0 && right <= static_cast<float> (other.width - 1) &&
            bottom <= static_cast<float> (other.height - 1)))
      return false;
    const auto last_before = [] (float place) { return static_cast<int> (std::ceil (place)) - 1; };
    const int first_x = static_cast<int> (left), first_y = static_cast<int> (top),
              last_x = std::max (first_x, last_before (right)),
              last_y = std::max (first_y, last_before (bottom));
    for (int y = first_y; y <= last_y; y++)
      if (std::memchr (owner.images_[winner].surface.row (y) + first_x, 0,
              static_cast<std::size_t> (last_x - first_x + 1)))
        return false;
    return true;
  }

  [[nodiscard]] bool is_covered (int x, int y, std::uint8_t winner)
  {
    const float here = depth.at (x, y);
    const Place place = place_of (x, y, winner);
    if (!place.on_surface)
      return false;
    float u[9], v[9]; /* of the pixel and its neighbours, or itself for those that do not join it */
    float left = place.u, right = place.u, top = place.v, bottom = place.v;
    for (int k = 0; k < 9; k++) {
      u[k] = place.u, v[k] = place.v;
      const int column = x + k % 3 - 1, row = y + k / 3 - 1;
      if (column < 0 || row < 0 || column >= depth.width || row >= depth.height)
        continue;
      const float there = depth.at (column, row);
      if (!(there > 0) || std::abs (there - here) > kDepthStep * std::min (there, here))
        continue;
      const Place &neighbour = place_of (column, row, winner);
      if (!neighbour.on_surface)
        return false;
      u[k] = neighbour.u, v[k] = neighbour.v;
      const float to_u = place.u + overlap * (u[k] - place.u),
                  to_v = place.v + overlap * (v[k] - place.v);
      left = std::min (left, to_u), right = std::max (right, to_u);
      top = std::min (top, to_v), bottom = std::max (bottom, to_v);
    }
    const float right_u = u[2] + u[5] + u[8] - u[0] - u[3] - u[6],
                right_v = v[2] + v[5] + v[8] - v[0] - v[3] - v[6],
                down_u = u[6] + u[7] + u[8] - u[0] - u[1] - u[2],
                down_v = v[6] + v[7] + v[8] - v[0] - v[1] - v[2];
    const bool is_facing = right_u * down_v - right_v * down_u >= 0; /* 0: a point alone */
    return is_facing && is_closed (winner, left, right, top, bottom);
  }

  /* @return how many points go */
  std::size_t run ()
  {
    std::size_t count = 0;
    ImageState &state = owner.images_[own];
    for (int y = 0; y < depth.height; y++)
      for (int x = 0; x < depth.width; x++) {
        std::uint8_t &winner = state.winner.row (y)[x];
        if (winner == kNoWinner || !is_covered (x, y, winner))
          continue;
        winner = kGoes;
        for (int row = std::max (0, y - 1); row <= y; row++)
          for (int column = std::max (0, x - 1); column <= x; column++)
            state.surface.row (row)[column] = 0;
        count++;
      }
    return count;
  }
};

std::size_t
RedundantPoints::find (const DecidedFrame &frame, double overlap, int threads)
{
  std::size_t largest = 0;
  for (const RangeImage &image : frame.images)
    largest = std::max (largest, static_cast<std::size_t> (image.depth.width) *
                                     static_cast<std::size_t> (image.depth.height));
  if (places_.size () < largest)
    places_.resize (largest);
  in_parallel (frame.images.size (), threads, [&] (std::size_t i) {
    ImageState &state = images_[i];
    state.winners = 0;
    state.winner.reset (frame.images[i], kNoWinner);
    state.surface.reset (frame.images[i], 0);
    make_surface (frame.images[i], state.surface.bytes.data ());
    const WorldPoints::Part part = frame.cloud.parts ()[i];
    for (std::size_t k = part.begin; k < part.end; k++) {
      const int winner = frame.grid.winner_of (k);
      if (winner < 0 || winner == static_cast<int> (i))
        continue;
      const std::uint32_t pixel = frame.cloud.pixel[k];
      state.winner.row (static_cast<int> (pixel >> 16))[pixel & 0xffff] =
          static_cast<std::uint8_t> (winner);
      state.winners |= std::uint64_t{1} << winner;
    }
  });
  std::size_t count = 0;
  for (std::size_t i = 0; i < frame.images.size (); i++)
    if (images_[i].winners)
      count += Comparison (*this, frame, i, static_cast<float> (overlap)).run ();
  return count;
}

void
RedundantPoints::clear (std::span<const RangeImage> images)
{
  for (std::size_t i = 0; i < images.size (); i++)
    for (int y = 0; y < images[i].depth.height && images_[i].winners; y++) {
      const std::uint8_t *winner = images_[i].winner.row (y);
      for (int x = 0; x < images[i].depth.width; x++)
        if (winner[x] == kGoes)
          images[i].depth.row (y)[x] = kInvalidDepth;
    }
}

} // namespace rangecast
