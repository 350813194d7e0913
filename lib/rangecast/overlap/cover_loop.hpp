/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The loop of redundant_points.cpp over the pixels of an image that another one won, some columns
 * at a time: where the winner sees each and its neighbours, whether that is on the winner's
 * surface, and so whether the pixel goes. */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "../base/simd.hpp"
#include "../geometry/pixel_transfer.hpp"
#include "redundant_points.hpp"

namespace rangecast {

/* Neighbours whose depths differ by more than this share are not joined; as striprender's
 * depth-step. */
constexpr float kDepthStep = 0.03f;
/* Maximum distance of a point from a surface that it lies on, in footprints of that view's pixels
 * along the surface. 0 would do for exact depth. */
constexpr float kTolerance = 1;

/* Whether pixels of one image cover those of another that it won: the winner, called "other". */
template <typename L> struct RedundantPoints::CoverLoop {
  using F = typename L::F;
  using I = typename L::I;
  static constexpr int kLanes = L::kLanes;
  /* Elements of a Row before its first pixel, and after its last. */
  static constexpr int kPad = kMaxLanes;

  RedundantPoints &owner;
  const RangeImage &image, &other;
  ImageState &state, &other_state;
  int winner;
  float overlap;
  PixelTransfer transfer; /* to the other image */
  float per_focal;        /* of the other image */

  CoverLoop (RedundantPoints &points, const ResolvedFrame &frame, std::size_t own,
      std::size_t rival, double reach)
      : owner (points), image (frame.images[own]), other (frame.images[rival]),
        state (points.images_[own]), other_state (points.images_[rival]),
        winner (static_cast<int> (rival)), overlap (static_cast<float> (reach)),
        transfer (frame.rays[own], image.roi, frame.lookups[rival], other.roi)
  {
    const auto length = [] (const float *v) { return std::hypot (v[0], v[1], v[2]); };
    per_focal = length (frame.rays[rival].right) * length (frame.lookups[rival].rows[2]);
  }

  /* The places of a row's pixels that are candidates, or beside one. */
  Row &make_row (int y) const
  {
    Row &row = owner.rows_[static_cast<std::size_t> (y + 3) % 3];
    if (row.y == y)
      return row;
    row.y = y;
    const bool is_in = y >= 0 && y < image.depth.height;
    int begin = image.depth.width, end = 0;
    for (int near = std::max (0, y - 1); near <= std::min (y + 1, image.depth.height - 1); near++) {
      const Range &range = owner.candidates_[static_cast<std::size_t> (near)];
      if (range.begin < range.end) {
        begin = std::min (begin, range.begin - 1);
        end = std::max (end, range.end + 1);
      }
    }
    float *depth = row.depth.data () + kPad;
    std::fill (depth + begin, depth + std::max (begin, end) + kLanes, 0.f);
    if (is_in)
      for (int x = std::max (0, begin); x < std::min (end, image.depth.width); x++)
        depth[x] = image.depth.row (y)[x];
    for (int x = begin; x < end; x += kLanes)
      place (row, x, y);
    return row;
  }

  /* A place this near a pixel is that pixel, so that the outline of one view ends at another's. */
  static constexpr float kSnap = 1.f / 32;
  static float snapped (float place)
  {
    const auto pixel = static_cast<float> (static_cast<int> (place + 0.5f));
    return std::abs (place - pixel) < kSnap ? pixel : place;
  }

  /* Where the other image sees some pixels of a row, and whether they lie on its surface. */
  void place (Row &row, int first, int y) const
  {
    const std::size_t at = static_cast<std::size_t> (kPad + first);
    F x;
    for (int i = 0; i < kLanes; i++)
      x[i] = static_cast<float> (first + i);
    const F depth = L::at (&row.depth[at]);
    F seen_at[3];
    for (int k = 0; k < 3; k++)
      seen_at[k] = transfer.origin[k] +
                   depth * (transfer.corner[k] + static_cast<float> (y) * transfer.down[k] +
                               x * transfer.right[k]);
    const F z = seen_at[2];
    F u = seen_at[0] / z, v = seen_at[1] / z;
    const I seen = (depth > 0) & (z > 0) & (u > -kSnap) & (v > -kSnap) &
                   (u < static_cast<float> (other.depth.width - 1) + kSnap) &
                   (v < static_cast<float> (other.depth.height - 1) + kSnap);
    for (int i = 0; i < kLanes; i++)
      if (seen[i]) {
        u[i] = snapped (u[i]);
        v[i] = snapped (v[i]);
      }
    L::at (&row.u[at]) = u;
    L::at (&row.v[at]) = v;
    compare_depths (u, v, z, seen, L::at (&row.on_surface[at]));
  }

  /* Whether a point lies on the surface of the four pixels around its place. */
  void compare_depths (const F &u, const F &v, const F &z, const I &seen, I &on_surface) const
  {
    F corners[4] = {}, right_share = {}, down_share = {};
    for (int i = 0; i < kLanes; i++) {
      if (!seen[i])
        continue;
      const int left = static_cast<int> (u[i]), top = static_cast<int> (v[i]);
      right_share[i] = u[i] - static_cast<float> (left);
      down_share[i] = v[i] - static_cast<float> (top);
      const int beside = right_share[i] > 0 ? 1 : 0;
      const std::uint16_t *upper = other.depth.row (top) + left,
                          *lower = other.depth.row (top + (down_share[i] > 0 ? 1 : 0)) + left;
      corners[0][i] = upper[0];
      corners[1][i] = upper[beside];
      corners[2][i] = lower[0];
      corners[3][i] = lower[beside];
    }
    F nearest = corners[0], farthest = corners[0];
    for (int k = 1; k < 4; k++) {
      nearest = corners[k] < nearest ? corners[k] : nearest;
      farthest = corners[k] > farthest ? corners[k] : farthest;
    }
    const F above = corners[0] + right_share * (corners[1] - corners[0]),
            below = corners[2] + right_share * (corners[3] - corners[2]);
    F off = z - (above + down_share * (below - above));
    L::make_positive (off);
    on_surface =
        seen & (nearest > 0) & (off <= kTolerance * (z * per_focal + (farthest - nearest)));
  }

  /* Bounding box of a pixel and the triangles around it, in the other image's plane. */
  struct Extent {
    F left, right, top, bottom;
  };

  /* Where a pixel and its neighbours are seen, row by row; the pixel itself for those that do not
   * join it. */
  struct Patch {
    F u[9], v[9];
    I on_surface; /* all of them are */
  };

  void make_patch (Patch &patch, const Row *const (&rows)[3], int first) const
  {
    const auto at = static_cast<std::ptrdiff_t> (kPad + first);
    const F depth = L::at (rows[1]->depth.data () + at), u = L::at (rows[1]->u.data () + at),
            v = L::at (rows[1]->v.data () + at);
    patch.on_surface = I{} - 1;
    for (int k = 0; k < 9; k++) {
      const Row &row = *rows[k / 3];
      const std::ptrdiff_t there = at + k % 3 - 1;
      const F neighbour = L::at (row.depth.data () + there);
      F step = neighbour - depth;
      L::make_positive (step);
      const I joined =
          (step <= kDepthStep * (neighbour < depth ? neighbour : depth)) & (neighbour > 0);
      patch.u[k] = joined ? L::at (row.u.data () + there) : u;
      patch.v[k] = joined ? L::at (row.v.data () + there) : v;
      patch.on_surface &= L::at (row.on_surface.data () + there) | ~joined;
    }
  }

  /* -1 where the other image sees the same side of the surface. */
  static void find_facing (const Patch &patch, I &facing)
  {
    const F *u = patch.u, *v = patch.v;
    const F right_u = u[2] + u[5] + u[8] - u[0] - u[3] - u[6],
            right_v = v[2] + v[5] + v[8] - v[0] - v[3] - v[6],
            down_u = u[6] + u[7] + u[8] - u[0] - u[1] - u[2],
            down_v = v[6] + v[7] + v[8] - v[0] - v[1] - v[2];
    facing = right_u * down_v - right_v * down_u >= 0; /* 0: a point alone */
  }

  /* Finds the candidates among some pixels that go. */
  void decide (const Row *const (&rows)[3], int first, int end, int y) const
  {
    Patch patch;
    make_patch (patch, rows, first);
    I covered;
    find_facing (patch, covered);
    covered &= patch.on_surface;
    if (!L::any (covered))
      return;
    const F u = patch.u[4], v = patch.v[4];
    Extent extent = {u, u, v, v};
    for (int k = 0; k < 9; k++) {
      const F to_u = u + overlap * (patch.u[k] - u), to_v = v + overlap * (patch.v[k] - v);
      extent.left = to_u < extent.left ? to_u : extent.left;
      extent.right = to_u > extent.right ? to_u : extent.right;
      extent.top = to_v < extent.top ? to_v : extent.top;
      extent.bottom = to_v > extent.bottom ? to_v : extent.bottom;
    }
    covered &= (extent.left >= 0) & (extent.top >= 0) &
               (extent.right <= static_cast<float> (other.depth.width - 1)) &
               (extent.bottom <= static_cast<float> (other.depth.height - 1));
    std::uint8_t *won = state.winner.row (y) + first;
    for (int i = 0; i < std::min (kLanes, end - first); i++)
      if (covered[i] && won[i] == winner &&
          is_closed (static_cast<int> (extent.left[i]), last_before (extent.right[i]),
              static_cast<int> (extent.top[i]), last_before (extent.bottom[i]))) {
        won[i] = kGoes;
        for (int row = y - 1; row <= y; row++)
          std::fill_n (state.surface.row (row) + first + i - 1, 2, std::uint8_t{0});
        owner.count_++;
      }
  }

  /* The last pixel before a place. */
  static int last_before (float place) { return static_cast<int> (std::ceil (place)) - 1; }

  /* Whether the other image has a closed surface between these pixels, and one further each way. */
  [[nodiscard]] bool is_closed (int left, int right_most, int top, int bottom) const
  {
    for (int y = top; y <= std::max (top, bottom); y++) {
      const std::uint8_t *row = other_state.surface.row (y);
      for (int x = left; x <= std::max (left, right_most); x += 8) {
        std::uint64_t eight;
        std::memcpy (&eight, row + x, sizeof eight);
        const int beyond = std::max (0, x + 7 - std::max (left, right_most));
        if ((~eight & ~std::uint64_t{0} >> 8 * beyond) != 0)
          return false;
      }
    }
    return true;
  }

  void run () const
  {
    for (Row &row : owner.rows_)
      row.y = -2;
    for (int y = 0; y < image.depth.height; y++) {
      const Range &range = owner.candidates_[static_cast<std::size_t> (y)];
      if (range.begin == range.end)
        continue;
      const Row *const rows[] = {&make_row (y - 1), &make_row (y), &make_row (y + 1)};
      for (int x = range.begin; x < range.end; x += kLanes)
        decide (rows, x, range.end, y);
    }
  }
};

} // namespace rangecast
