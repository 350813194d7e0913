/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "edge_filter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "../base/parallel.hpp"
#include "disparity_filter.hpp"

namespace rangecast {
namespace {

constexpr int kReach = 7;
constexpr float kDamping = 0.5f; /* of slopes: pixels along a line do not show that across it */

/* Sums over pixels around one: columns, rows and disparities relative to it. */
struct Sums {
  int n = 0, x = 0, y = 0, d = 0, xx = 0, xy = 0, yy = 0, xd = 0, yd = 0;

  /* The damped least-squares plane at the pixel itself. */
  [[nodiscard]] float value () const
  {
    const float count = float (n), mx = float (x) / count, my = float (y) / count,
                md = float (d) / count, cxx = float (xx) - mx * float (x) + kDamping * count,
                cxy = float (xy) - mx * float (y),
                cyy = float (yy) - my * float (y) + kDamping * count,
                cxd = float (xd) - mx * float (d), cyd = float (yd) - my * float (d),
                determinant = cxx * cyy - cxy * cxy;
    const float slope_x = (cxd * cyy - cyd * cxy) / determinant,
                slope_y = (cyd * cxx - cxd * cxy) / determinant;
    return md - slope_x * mx - slope_y * my;
  }
};

} // namespace

void
EdgeFilter::apply (int min, int n_threads, cv::Mat &disparity)
{
  const int width = disparity.cols, height = disparity.rows;
  edges_.resize (std::size_t (height));
  in_parallel (std::size_t (height), n_threads, [&] (std::size_t row) {
    const int y = int (row);
    const auto d = disparity.ptr<std::uint16_t> (y),
               above = disparity.ptr<std::uint16_t> (std::max (y - 1, 0)),
               below = disparity.ptr<std::uint16_t> (std::min (y + 1, height - 1));
    edges_[row].clear ();
    for (int x = 0; x < width; x++) {
      if (d[x] < min)
        continue;
      const int left = d[std::max (x - 1, 0)], right = d[std::min (x + 1, width - 1)];
      const int step = std::max ({std::abs (left - d[x]), std::abs (right - d[x]),
          std::abs (above[x] - d[x]), std::abs (below[x] - d[x])});
      if (step > kSurfaceStep * d[x])
        edges_[row].push_back ({static_cast<std::int16_t> (x), d[x]});
    }
  });
  in_parallel (std::size_t (height), n_threads, [&] (std::size_t row) {
    const int y = int (row), first = std::max (y - kReach, 0),
              last = std::min (y + kReach, height - 1);
    const auto to = disparity.ptr<std::uint16_t> (y);
    std::size_t begins[2 * kReach + 1] = {};
    for (const Pixel &at : edges_[row]) {
      const double most = kSurfaceStep * at.disparity;
      Sums sums;
      for (int v = first; v <= last; v++) {
        const auto &there = edges_[std::size_t (v)];
        std::size_t &begin = begins[v - first];
        while (begin < there.size () && there[begin].x < at.x - kReach)
          begin++;
        for (std::size_t i = begin; i < there.size () && there[i].x <= at.x + kReach; i++) {
          const int dx = there[i].x - at.x, dy = v - y, dd = there[i].disparity - at.disparity;
          if (std::abs (dd) > most)
            continue;
          sums.n++;
          sums.x += dx, sums.y += dy, sums.d += dd;
          sums.xx += dx * dx, sums.xy += dx * dy, sums.yy += dy * dy;
          sums.xd += dx * dd, sums.yd += dy * dd;
        }
      }
      to[at.x] = static_cast<std::uint16_t> (
          std::max (min, at.disparity + static_cast<int> (std::lround (sums.value ()))));
    }
  });
}

} // namespace rangecast
