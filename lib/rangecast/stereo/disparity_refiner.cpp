/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Windows around single pixels are summed in vectors of fixed width (OpenCV's for bytes, eight
 * floats), so that the order of float additions does not depend on the processor. */
#include "disparity_refiner.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* Radius of the plane fit and of the patches compared, pixels. */
constexpr int kPlane = 3, kPatch = 4, kPad = std::max (kPlane, kPatch);
/* Maximum difference within a surface: in disparity (pixels) of adjacent pixels, more for each
 * pixel of distance; in colour (sum over R, G, B). */
constexpr float kStep = 1.0f, kSlant = 0.5f;
constexpr int kAlike = 110;
/* Minimum sum of squared gradients of a patch that exceeds noise. */
constexpr float kDull = 15;
/* Maximum grey level difference of the same point in both images. */
constexpr float kUnlike = 20;
/* Maximum change of a disparity in one iteration, and in total, pixels. */
constexpr float kMax = 0.5f, kMaxOfAll = 1;

/* Positions in a word of bytes that are adjacent in memory. */
constexpr int kFirst = std::endian::native == std::endian::little ? 0 : 24;
constexpr int kNext = kFirst == 0 ? 8 : -8;
constexpr int kByte[] = {kFirst, kFirst + kNext, kFirst + 2 * kNext, kFirst + 3 * kNext};

/* Sums over windows of kSide x kSide pixels, row by row. */
template <int kSide, typename T> class WindowSums {
public:
  /** @param from    the first row, from the first column of the first window on
   *  @param step    elements from row to row
   *  @param width   windows in a row
   *  @param columns scratch memory; @param[out] sums  those of the row, after next() */
  WindowSums (
      const T *from, std::ptrdiff_t step, int width, std::vector<T> &columns, std::vector<T> &sums)
      : next_ (from), step_ (step), width_ (width)
  {
    const auto n = std::size_t (width) + kSide - 1;
    columns.assign (2 * n, 0);
    sums.resize (n);
    columns_ = columns.data ();
    threes_ = columns_ + n;
    sums_ = sums.data ();
    for (int k = 0; k < kSide - 1; k++, next_ += step)
      for (std::size_t x = 0; x < n; x++)
        columns_[x] = T (columns_[x] + next_[x]);
  }
  void next ()
  {
    static_assert (kSide == 7 || kSide == 9);
    T *__restrict columns = columns_, *__restrict threes = threes_, *__restrict sums = sums_;
    const T *__restrict come = next_, *__restrict go = gone_;
    const int n = width_ + kSide - 1;
    if (!go)
      for (int x = 0; x < n; x++)
        columns[x] = T (columns[x] + come[x]);
    else
      for (int x = 0; x < n; x++)
        columns[x] = T (T (columns[x] - go[x]) + come[x]);
    for (int x = 0; x < n - 2; x++)
      threes[x] = T (columns[x] + columns[x + 1] + columns[x + 2]);
    const T *last = kSide == 9 ? threes : columns;
    for (int x = 0; x < width_; x++)
      sums[x] = T (threes[x] + threes[x + 3] + last[x + 6]);
    next_ += step_;
    gone_ = next_ - kSide * step_;
  }

private:
  const T *next_, *gone_ = nullptr; /* rows that come in and go out */
  const std::ptrdiff_t step_;
  const int width_;
  T *columns_, *threes_, *sums_;
};

/* One bit per neighbour, eight per row, of which the last is unused. */
using Members = std::uint64_t;
constexpr int kLanes = 2 * kPlane + 2;
static_assert (kLanes == 8 && kPlane == 3);
using Floats = cv::v_float32x4;
using Row = Lanes<kLanes>; /* of a window */

/* All bits of the lanes of members in row v; no bits of others. */
inline void
choose_row (Members members, int v, Row::I &mask)
{
  const Row::I bits = {1, 2, 4, 8, 16, 32, 64, 128};
  mask = (bits & int (members >> (8 * (v + kPlane)) & 255)) == bits;
}

inline float
sum_of (const Row::F &v)
{
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

/* The shift that minimizes the difference between both images, without its mean: cameras may differ
 * in brightness. From sums over n pixels. */
inline float
best_shift (float product, float square, float slope, float difference, float n)
{
  const float by = (slope * difference - n * product) / (n * (square + kDull) - slope * slope);
  return std::min (std::max (by, -kMax), kMax);
}

} // namespace

void
DisparityRefiner::begin (const cv::Size &size, const Tiles &tiles)
{
  const cv::Size all (size.width + 2 * kPad + 8, size.height + 2 * kPad); /* 8: ends of vectors */
  for (cv::Mat *m : {&first_, &now_, &next_})
    m->create (all, CV_32F);
  for (cv::Mat *m : {&steps_, &valid_, &colours_[0], &colours_[1], &colours_[2]})
    m->create (all, CV_8U);
  /* Around the parts there are no disparities. */
  for (const cv::Rect &part : tiles.parts ())
    for (const cv::Rect &edge : {cv::Rect (part.x, part.y, part.width + 2 * kPad, kPad),
             cv::Rect (part.x, part.br ().y + kPad, part.width + 2 * kPad, kPad),
             cv::Rect (part.x, part.y + kPad, kPad, part.height),
             cv::Rect (part.br ().x + kPad, part.y + kPad, kPad, part.height)}) {
      for (cv::Mat *m : {&first_, &now_, &next_, &valid_})
        (*m) (edge).setTo (0);
      steps_ (edge).setTo (1);
    }
  parts_.clear ();
  for (const cv::Rect &tile : tiles.tiles ())
    parts_.push_back ({tile, {}});
  memory_.reserve (tiles.workers ());
}

/* Copies a part of the image and shrinks it to the columns with disparities. From then on parts are
 * in the coordinates of the padded planes. */
void
DisparityRefiner::load (const Job &job, const cv::Mat &disparity, cv::Rect &part)
{
  int begin = part.width, end = 0;
  for (int y = 0; y < part.height; y++) {
    const auto pixels = job.colour.ptr<std::uint8_t> (part.y + y) + 4 * part.x;
    for (int c = 0; c < 3; c++) {
      auto to = colours_[c].ptr<std::uint8_t> (part.y + y + kPad) + part.x + kPad;
      for (int x = 0; x < part.width; x++)
        to[x] = pixels[4 * x + c];
    }
    const auto d = disparity.ptr<std::int16_t> (part.y + y) + part.x;
    auto first = first_.ptr<float> (part.y + y + kPad) + part.x + kPad,
         now = now_.ptr<float> (part.y + y + kPad) + part.x + kPad;
    std::fill_n (next_.ptr<float> (part.y + y + kPad) + part.x + kPad, part.width, 0.f);
    std::fill_n (valid_.ptr<std::uint8_t> (part.y + y + kPad) + part.x + kPad, part.width, 0);
    std::fill_n (steps_.ptr<std::uint8_t> (part.y + y + kPad) + part.x + kPad, part.width, 1);
    for (int x = 0; x < part.width; x++)
      now[x] = first[x] = float (std::max (d[x] - job.nearest + 1, 0)) * (1 / 16.f);
    int x0 = 0, x1 = part.width;
    while (x0 < begin && d[x0] < job.nearest)
      x0++;
    while (x1 > end && d[x1 - 1] < job.nearest)
      x1--;
    begin = std::min (begin, x0);
    end = std::max (end, x1);
  }
  part = cv::Rect (part.x + kPad + begin, part.y + kPad, std::max (0, end - begin), part.height);
}

void
DisparityRefiner::mark_steps (const cv::Rect &part)
{
  for (int y = part.y; y < part.br ().y; y++) {
    const auto above = first_.ptr<float> (y - 1) + part.x, own = first_.ptr<float> (y) + part.x,
               below = first_.ptr<float> (y + 1) + part.x;
    auto steps = steps_.ptr<std::uint8_t> (y) + part.x,
         valid = valid_.ptr<std::uint8_t> (y) + part.x;
    for (int x = 0; x < part.width; x++) {
      const float rows = std::max (std::abs (own[x] - above[x]), std::abs (own[x] - below[x])),
                  columns =
                      std::max (std::abs (own[x] - own[x - 1]), std::abs (own[x] - own[x + 1]));
      steps[x] = (std::max (rows, columns) > kStep) | (own[x] <= 0);
      valid[x] = own[x] > 0;
    }
  }
}

/* The neighbours that belong to the surface of a pixel, by disparity and colour. */
Members
DisparityRefiner::members_of (int x, int y) const
{
  constexpr float kA = kStep, kB = kStep + kSlant, kC = kStep + 2 * kSlant;
  alignas (16) static constexpr float kMaxAt[kPlane + 1][kLanes] = {
      {kC, kB, kA, kA, kA, kB, kC, -1}, {kC, kB, kA, kA, kA, kB, kC, -1},
      {kC, kB, kB, kB, kB, kB, kC, -1}, {kC, kC, kC, kC, kC, kC, kC, -1}};
  const Floats centre = cv::v_setall_f32 (now_.ptr<float> (y)[x]), zero = cv::v_setzero_f32 ();
  cv::v_uint8x16 own[3];
  for (int c = 0; c < 3; c++)
    own[c] = cv::v_setall_u8 (colours_[c].ptr<std::uint8_t> (y)[x]);
  const cv::v_uint8x16 alike = cv::v_setall_u8 (std::uint8_t (kAlike));
  Members members = 0;
  for (int v = -kPlane; v <= kPlane; v++) {
    cv::v_uint8x16 differs = cv::v_setzero_u8 ();
    for (int c = 0; c < 3; c++)
      differs = differs + cv::v_absdiff (own[c],
                              cv::v_load (colours_[c].ptr<std::uint8_t> (y + v) + x - kPlane));
    int bits = cv::v_signmask (differs <= alike);
    int near = 0;
    for (int part = 0; part < kLanes; part += 4) {
      const Floats d = cv::v_load (now_.ptr<float> (y + v) + x - kPlane + part),
                   max = cv::v_load_aligned (kMaxAt[std::abs (v)] + part);
      near |= cv::v_signmask ((cv::v_abs (d - centre) <= max) & (d > zero)) << part;
    }
    members |= Members (bits & near & 127) << (8 * (v + kPlane));
  }
  return members;
}

/* The value at its pixel of the least-squares plane through a surface is linear in the disparities
 * around: their weights are at + across * u + down * v. */
void
DisparityRefiner::fit_plane (Edge &edge)
{
  int n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  for (int v = -kPlane; v <= kPlane; v++) {
    const auto row = unsigned (edge.members >> (8 * (v + kPlane)) & 255);
    const auto count = [row] (unsigned bits) { return std::popcount (row & bits); };
    const int of_row = std::popcount (row), x1 = count (8 << 1) - count (8 >> 1),
              x2 = count (8 << 2) - count (8 >> 2), x3 = count (8 << 3) - count (8 >> 3);
    const int x = x1 + 2 * x2 + 3 * x3;
    n += of_row;
    sx += x;
    sxx += count (8 << 1 | 8 >> 1) + 4 * count (8 << 2 | 8 >> 2) + 9 * count (8 << 3 | 8 >> 3);
    sy += v * of_row;
    syy += v * v * of_row;
    sxy += v * x;
  }
  const float few = 0.02f * float (n); /* collinear pixels do not determine a plane */
  const float mx = float (sx) / float (n), my = float (sy) / float (n);
  const float cxx = float (sxx) - float (sx) * mx + few, cyy = float (syy) - float (sy) * my + few,
              cxy = float (sxy) - float (sx) * my, det = cxx * cyy - cxy * cxy;
  edge.across = (my * cxy - mx * cyy) / det;
  edge.down = (mx * cxy - my * cxx) / det;
  edge.at = 1 / float (n) - mx * edge.across - my * edge.down;
}

float
DisparityRefiner::on_plane (const Edge &edge) const
{
  const float own = now_.ptr<float> (edge.y)[edge.x];
  const Row::F u = {-3, -2, -1, 0, 1, 2, 3, 4};
  Row::F weights = u * edge.across + (edge.at - float (kPlane) * edge.down), sum = {};
  for (int v = -kPlane; v <= kPlane; v++, weights += edge.down) {
    Row::I mask;
    choose_row (edge.members, v, mask);
    Row::F off = (Row::at (now_.ptr<float> (edge.y + v) + edge.x - kPlane) - own) * weights;
    Row::keep_where (off, mask);
    sum += off;
  }
  return own + sum_of (sum);
}

/* Pixels near a step. */
void
DisparityRefiner::find_edges (Part &part, Memory &m)
{
  constexpr int kSide = 2 * kPlane + 1;
  const cv::Rect &at = part.at;
  part.edges.clear ();
  WindowSums<kSide, std::uint8_t> steps (steps_.ptr<std::uint8_t> (at.y - kPlane) + at.x - kPlane,
      std::ptrdiff_t (steps_.step1 ()), at.width, m.counts[0], m.counts[1]);
  for (int y = at.y; y < at.br ().y; y++) {
    steps.next ();
    const auto now = now_.ptr<float> (y) + at.x;
    for (int x = 0; x < at.width; x++)
      if (m.counts[1][std::size_t (x)] != 0 && now[x] > 0) {
        Edge &edge = part.edges.emplace_back ();
        edge.x = at.x + x;
        edge.y = y;
        edge.members = members_of (edge.x, y);
        fit_plane (edge);
      }
  }
}

/* From now_ to next_. Inside a surface, the plane's value is the mean. */
void
DisparityRefiner::smooth (const Part &part, Memory &m)
{
  constexpr int kSide = 2 * kPlane + 1;
  const cv::Rect &at = part.at;
  WindowSums<kSide, float> sums (now_.ptr<float> (at.y - kPlane) + at.x - kPlane,
      std::ptrdiff_t (now_.step1 ()), at.width, m.columns[0], m.sums[0]);
  for (int y = at.y; y < at.br ().y; y++) {
    sums.next ();
    const auto now = now_.ptr<float> (y) + at.x;
    auto next = next_.ptr<float> (y) + at.x;
    const float *sum = m.sums[0].data ();
    for (int x = 0; x < at.width; x++)
      next[x] = now[x] > 0 ? sum[x] * (1.f / (kSide * kSide)) : 0;
  }
  for (const Edge &edge : part.edges)
    next_.ptr<float> (edge.y)[edge.x] = std::max (on_plane (edge), 1 / 16.f);
}

/* Grey level difference of the left image and the right one at next_, and the gradient of the right
 * one, of a part and kPatch pixels around. */
void
DisparityRefiner::compare (const Job &job, const cv::Rect &at, Memory &m) const
{
  const int width = at.width + 2 * kPatch, height = at.height + 2 * kPatch,
            x0 = at.x - kPatch - kPad, y0 = at.y - kPatch - kPad; /* in the image */
  m.stride = width + kLanes;
  for (std::vector<float> &plane : m.planes)
    plane.assign (std::size_t (m.stride) * std::size_t (height), 0);
  const int begin = std::max (0, -x0), n = std::min (width, job.left.cols - x0) - begin;
  m.at.resize (std::size_t (n));
  m.greys.resize (std::size_t (n));
  m.shifts.resize (std::size_t (std::max (n, at.width)));
  std::int32_t *to = m.at.data ();
  std::uint32_t *greys = m.greys.data ();
  float *shares = m.shifts.data ();
  const std::int32_t last = job.right.cols - 3;
  const float origin = float (job.right_x + x0 + begin) - float (job.nearest - 1) * (1 / 16.f);
  for (int y = std::max (0, -y0); y < std::min (height, job.left.rows - y0); y++) {
    const auto left = job.left.ptr<std::uint8_t> (y0 + y) + x0 + begin,
               right = job.right.ptr<std::uint8_t> (y0 + y);
    const auto d = next_.ptr<float> (y0 + y + kPad) + x0 + begin + kPad;
    const std::ptrdiff_t row = std::ptrdiff_t (y) * m.stride + begin;
    float *__restrict products = m.planes[0].data () + row,
                      *__restrict squares = m.planes[1].data () + row,
                      *__restrict slopes = m.planes[2].data () + row,
                      *__restrict differences = m.planes[3].data () + row;
    for (std::int32_t x = 0; x < n; x++) {
      const float there = origin + float (x) - d[x];
      to[x] = std::clamp (std::int32_t (there), std::int32_t{1}, last);
      shares[x] = std::min (std::max (there - float (to[x]), 0.f), 1.f);
    }
    for (int x = 0; x < n; x++)
      std::memcpy (&greys[x], right + to[x] - 1, 4);
    for (int x = 0; x < n; x++) {
      const std::uint32_t g = greys[x];
      const auto g0 = float (int (g >> kByte[0] & 255)), g1 = float (int (g >> kByte[1] & 255)),
                 g2 = float (int (g >> kByte[2] & 255)), g3 = float (int (g >> kByte[3] & 255));
      const float f = shares[x], slope = 0.5f * ((g2 - g0) * (1 - f) + (g3 - g1) * f),
                  differs = float (left[x]) - (g1 + f * (g2 - g1));
      const float counts = d[x] > 0 ? slope : 0,
                  difference = d[x] > 0 ? std::min (std::max (differs, -kUnlike), kUnlike) : 0;
      differences[x] = difference;
      slopes[x] = counts;
      products[x] = difference * counts;
      squares[x] = counts * counts;
    }
  }
}

/* @param at  the part of memory.planes */
float
DisparityRefiner::shift_of (const Edge &edge, const cv::Rect &at, const Memory &m)
{
  Row::F sums[4] = {};
  const std::ptrdiff_t first =
      std::ptrdiff_t (edge.y - at.y + kPatch - kPlane) * m.stride + edge.x - at.x + kPatch - kPlane;
  const float *planes[4];
  for (int i = 0; i < 4; i++)
    planes[i] = m.planes[i].data () + first;
  for (int v = -kPlane; v <= kPlane; v++) {
    Row::I mask;
    choose_row (edge.members, v, mask);
    for (int i = 0; i < 4; i++, planes[i - 1] += m.stride) {
      Row::F value = Row::at (planes[i]);
      Row::keep_where (value, mask);
      sums[i] += value;
    }
  }
  return best_shift (sum_of (sums[0]), sum_of (sums[1]), sum_of (sums[2]), sum_of (sums[3]),
      float (std::popcount (edge.members)));
}

/* From next_ to now_: see best_shift(). */
void
DisparityRefiner::move (const Job &job, const Part &part, Memory &m)
{
  constexpr int kSide = 2 * kPatch + 1;
  const cv::Rect &at = part.at;
  compare (job, at, m);
  const auto sums_of = [&] (int i) {
    return WindowSums<kSide, float> (
        m.planes[i].data (), m.stride, at.width, m.columns[i], m.sums[i]);
  };
  WindowSums<kSide, float> sums[] = {sums_of (0), sums_of (1), sums_of (2), sums_of (3)};
  WindowSums<kSide, std::uint8_t> counts (valid_.ptr<std::uint8_t> (at.y - kPatch) + at.x - kPatch,
      std::ptrdiff_t (valid_.step1 ()), at.width, m.counts[0], m.counts[1]);
  /* Limits the total change. */
  const auto limit = [] (float moved, float first) {
    return std::min (std::max (moved, std::max (first - kMaxOfAll, 1 / 16.f)), first + kMaxOfAll);
  };
  for (int y = at.y; y < at.br ().y; y++) {
    for (auto &s : sums)
      s.next ();
    counts.next ();
    const float *product = m.sums[0].data (), *square = m.sums[1].data (),
                *slope = m.sums[2].data (), *difference = m.sums[3].data ();
    const std::uint8_t *count = m.counts[1].data ();
    const auto first = first_.ptr<float> (y) + at.x, d = next_.ptr<float> (y) + at.x;
    auto to = now_.ptr<float> (y) + at.x;
    for (int x = 0; x < at.width; x++) {
      const float shift = best_shift (
          product[x], square[x], slope[x], difference[x], float (std::max<int> (count[x], 1)));
      to[x] = d[x] > 0 ? limit (d[x] + shift, first[x]) : 0;
    }
  }
  for (const Edge &edge : part.edges) {
    const float d = next_.ptr<float> (edge.y)[edge.x];
    now_.ptr<float> (edge.y)[edge.x] =
        limit (d + shift_of (edge, at, m), first_.ptr<float> (edge.y)[edge.x]);
  }
}

void
DisparityRefiner::put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const
{
  for (int y = part.y; y < part.br ().y; y++) {
    auto to = disparity.ptr<std::int16_t> (y - kPad) + part.x - kPad;
    const auto d = next_.ptr<float> (y) + part.x;
    for (int x = 0; x < part.width; x++)
      if (d[x] > 0)
        to[x] =
            std::int16_t (std::min (std::max (int (16 * d[x] + 0.5f), 1) + job.nearest - 1, 32767));
  }
}

void
DisparityRefiner::apply (const Job &job, const Tiles &tiles, cv::Mat &disparity)
{
  if (job.iterations <= 0 || job.right.cols < 4)
    return;
  begin (disparity.size (), tiles);
  const auto each = [&] (const auto &work) {
    in_parallel (parts_.size (), tiles.n_threads (), [&] (std::size_t i, std::size_t worker) {
      for_this_cpu ([&, &memory = memory_.of (worker)] { work (parts_[i], memory); });
    });
  };
  each ([&] (Part &part, Memory &) { load (job, disparity, part.at); });
  std::erase_if (parts_, [] (const Part &part) { return part.at.empty (); });
  each ([&] (const Part &part, Memory &) { mark_steps (part.at); });
  each ([&] (Part &part, Memory &m) { find_edges (part, m); });
  each ([&] (const Part &part, Memory &m) { smooth (part, m); });
  for (int i = 0; i < job.iterations; i++) {
    each ([&] (const Part &part, Memory &m) { move (job, part, m); });
    each ([&] (const Part &part, Memory &m) { smooth (part, m); });
  }
  each ([&] (const Part &part, Memory &) { put_back (job, part.at, disparity); });
}

} // namespace rangecast
