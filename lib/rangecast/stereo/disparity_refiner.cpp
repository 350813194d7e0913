/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Each lane of a vector is a pixel, so that the order of float additions does not depend on the
 * processor. */
#include "disparity_refiner.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace rangecast {
namespace {

/* Radius of the plane fit and of the patches compared, pixels. */
constexpr int kPlane = 3, kPatch = 4, kPad = std::max (kPlane, kPatch);
constexpr int kPlaneSide = 2 * kPlane + 1, kPatchSide = 2 * kPatch + 1;
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

/* More of them hardly change anything; without any, the median error doubles. */
constexpr int kIterations = 2;

/* Rows of differences that are kept: a power of two, those of a patch and one more. */
constexpr int kRows = 16;
static_assert (kRows > kPatchSide);

/* R, G and B of a pixel, without the last byte. */
constexpr std::uint32_t kColour = 0xffffff;

/* The sum of kSide columns from x on, given also those of three successive columns. */
template <int kSide, typename T>
inline T
sum_at (const T *columns, const T *threes, int x)
{
  static_assert (kSide == 7 || kSide == 9);
  return T (threes[x] + threes[x + 3] + (kSide == 9 ? threes : columns)[x + 6]);
}

template <typename T>
inline void
add_threes (const T *__restrict columns, int n, T *__restrict threes)
{
  for (int x = 0; x < n - 2; x++)
    threes[x] = T (columns[x] + columns[x + 1] + columns[x + 2]);
}

/* Bytes that are processed together, so that none of a row are left over. */
constexpr int kBytes = 32;

/* The numbers of pixels with a disparity in the patches of a row, at least 1. */
inline void
count_row (const std::uint8_t *__restrict columns, const std::uint8_t *__restrict threes, int n,
    float *__restrict counts)
{
  for (int begin = 0; begin < n; begin += kBytes)
    for (int x = begin; x < begin + kBytes; x++)
      counts[x] = float (std::max<int> (sum_at<kPatchSide> (columns, threes, x), 1));
}

/* Marks pixels with a disparity in whose window a step was counted. */
inline void
mark_row (const std::uint8_t *__restrict columns, const std::uint8_t *__restrict threes,
    const std::uint8_t *__restrict valid, int n, std::uint8_t *__restrict marks)
{
  for (int begin = 0; begin < n; begin += kBytes)
    for (int x = begin; x < begin + kBytes; x++)
      marks[x] = (sum_at<kPlaneSide> (columns, threes, x) != 0) & valid[x];
}

/* Copies four bytes from each of n places. */
inline void
gather (const std::uint8_t *__restrict from, const std::int32_t *__restrict at, int n,
    std::int32_t *__restrict to)
{
  for (int x = 0; x < n; x++)
    std::memcpy (&to[x], from + at[x], 4);
}

/* Sums over windows of kSide x kSide pixels, row by row. */
template <int kSide, typename T> class WindowSums {
public:
  /** @param from    the first row, from the first column of the first window on
   *  @param step    elements from row to row
   *  @param width   windows in a row
   *  @param memory  scratch */
  WindowSums (const T *from, std::ptrdiff_t step, int width, std::vector<T> &memory)
      : next_ (from), step_ (step), n_ (width + kSide - 1)
  {
    const int room = n_ + kBytes;
    memory.assign (2 * std::size_t (room), 0);
    columns_ = memory.data ();
    threes_ = columns_ + room;
    for (int k = 0; k < kSide - 1; k++, next_ += step)
      for (int x = 0; x < n_; x++)
        columns_[x] = T (columns_[x] + next_[x]);
  }
  void next ()
  {
    T *__restrict columns = columns_;
    const T *__restrict come = next_, *__restrict go = gone_;
    if (!go)
      for (int x = 0; x < n_; x++)
        columns[x] = T (columns[x] + come[x]);
    else
      for (int x = 0; x < n_; x++)
        columns[x] = T (T (columns[x] - go[x]) + come[x]);
    add_threes (columns_, n_, threes_);
    next_ += step_;
    gone_ = next_ - kSide * step_;
  }
  /** For sum_at(), after next(). */
  [[nodiscard]] const T *columns () const { return columns_; }
  [[nodiscard]] const T *threes () const { return threes_; }

private:
  const T *next_, *gone_ = nullptr; /* rows that come in and go out */
  const std::ptrdiff_t step_;
  const int n_;
  T *columns_, *threes_;
};

/* Calls use (u, v, mask) for each neighbour of as many pixels as there are lanes: all bits of the
 * lanes of which it is a member. */
template <typename Lanes, typename Use>
inline void
for_members (const std::uint32_t *above, const std::uint32_t *below, const Use &use)
{
  typename Lanes::U bits = Lanes::at (above);
  for (int v = -kPlane; v <= kPlane; v++) {
    if (v == 1)
      bits = Lanes::at (below);
#pragma GCC unroll 7
    for (int u = -kPlane; u <= kPlane; u++) {
      const typename Lanes::I mask = (typename Lanes::I)bits >> 31;
      bits += bits;
      use (u, v, mask);
    }
  }
}

/* 0, 1, 2, ... */
template <typename Lanes>
inline void
count_lanes (typename Lanes::F &numbers)
{
  for (int i = 0; i < Lanes::kLanes; i++)
    numbers[i] = float (i);
}

/* The shift that minimizes the difference between both images, without its mean: cameras may differ
 * in brightness.
 * @param sums  over n pixels: gradient times difference of grey levels, gradient squared, gradient,
 * difference */
template <typename Lanes>
inline void
find_shift (
    const typename Lanes::F (&sums)[4], const typename Lanes::F &n, typename Lanes::F &shift)
{
  using F = typename Lanes::F;
  const F most = F{} + kMax,
          by = (sums[2] * sums[3] - n * sums[0]) / (n * (sums[1] + kDull) - sums[2] * sums[2]);
  shift = by > -most ? by : -most;
  shift = shift < most ? shift : most;
}

/* Limits the total change. */
template <typename Lanes>
inline void
limit (const typename Lanes::F &first, typename Lanes::F &moved)
{
  using F = typename Lanes::F;
  const F farthest = F{} + 1 / 16.f, high = first + kMaxOfAll;
  F low = first - kMaxOfAll;
  low = low > farthest ? low : farthest;
  moved = moved > low ? moved : low;
  moved = moved < high ? moved : high;
}

} // namespace

void
DisparityRefiner::begin (const cv::Size &size, const Tiles &tiles)
{
  static_assert (kPlane <= kPad && kGroup - 1 + kPlane <= kPad + kGroup);
  const cv::Size all (size.width + 2 * kPad + kGroup, size.height + 2 * kPad); /* ends of groups */
  for (cv::Mat *m : {&first_, &now_, &next_})
    m->create (all, CV_32F);
  for (cv::Mat *m : {&steps_, &valid_})
    m->create (all, CV_8U);
  colour_.create (all, CV_32S);
  /* Around the parts there are no disparities. */
  constexpr int kRight = kPad + kGroup;
  for (const cv::Rect &part : tiles.parts ())
    for (const cv::Rect &edge : {cv::Rect (part.x, part.y, kPad + part.width + kRight, kPad),
             cv::Rect (part.x, part.br ().y + kPad, kPad + part.width + kRight, kPad),
             cv::Rect (part.x, part.y + kPad, kPad, part.height),
             cv::Rect (part.br ().x + kPad, part.y + kPad, kRight, part.height)}) {
      for (cv::Mat *m : {&first_, &now_, &next_, &valid_})
        (*m) (edge).setTo (0);
      steps_ (edge).setTo (1);
    }
  parts_.resize (tiles.tiles ().size ());
  for (std::size_t i = 0; i < parts_.size (); i++)
    parts_[i].at = tiles.tiles ()[i];
  memory_.reserve (tiles.workers ());
}

/* Copies a part of the image and shrinks it to the columns with disparities. From then on parts are
 * in the coordinates of the padded planes. */
void
DisparityRefiner::load (const Job &job, const cv::Mat &disparity, cv::Rect &part)
{
  int begin = part.width, end = 0;
  for (int y = 0; y < part.height; y++) {
    const auto pixels = job.colour.ptr<std::uint32_t> (part.y + y) + part.x;
    const auto d = disparity.ptr<std::int16_t> (part.y + y) + part.x;
    const int row = part.y + y + kPad, column = part.x + kPad;
    auto colour = reinterpret_cast<std::uint32_t *> (colour_.ptr<std::int32_t> (row)) + column;
    auto first = first_.ptr<float> (row) + column, now = now_.ptr<float> (row) + column;
    std::fill_n (next_.ptr<float> (row) + column, part.width, 0.f);
    std::fill_n (valid_.ptr<std::uint8_t> (row) + column, part.width, 0);
    std::fill_n (steps_.ptr<std::uint8_t> (row) + column, part.width, 1);
    for (int x = 0; x < part.width; x++)
      colour[x] = pixels[x] & kColour;
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

/* Pixels near a step. */
template <typename Lanes>
void
DisparityRefiner::find_edges (Part &part, Memory &m)
{
  const cv::Rect &at = part.at;
  const auto n = std::size_t (at.width);
  part.edges.clear ();
  m.near.resize (n + kBytes + kGroup);
  WindowSums<kPlaneSide, std::uint8_t> steps (
      steps_.ptr<std::uint8_t> (at.y - kPlane) + at.x - kPlane, std::ptrdiff_t (steps_.step1 ()),
      at.width, m.counts);
  for (int y = at.y; y < at.br ().y; y++) {
    steps.next ();
    std::uint8_t *near = m.near.data ();
    mark_row (
        steps.columns (), steps.threes (), valid_.ptr<std::uint8_t> (y) + at.x, at.width, near);
    std::fill_n (near + n, kGroup, std::uint8_t{0});
    const std::uint8_t *next = near, *end = near + n;
    while (next < end && (next = static_cast<const std::uint8_t *> (
                              std::memchr (next, 1, std::size_t (end - next))))) {
      Edges &edges = part.edges.emplace_back ();
      edges.x = at.x + int (next - near);
      edges.y = y;
      for (int i = 0; i < kGroup; i++)
        edges.is[i] = -next[i];
      for (int i = 0; i < kGroup; i += Lanes::kLanes)
        fit_planes<Lanes> (edges, i);
      next += kGroup;
    }
  }
}

/* Finds the neighbours that belong to the surface of each pixel, by disparity and colour, and their
 * weights: the value at the pixel of the least-squares plane through them is linear in their
 * disparities, with weights at + across * u + down * v.
 * @param lane  the first pixel of as many as there are lanes */
template <typename Lanes>
void
DisparityRefiner::fit_planes (Edges &edges, int lane) const
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  using U = typename Lanes::U;
  using B = typename Lanes::B;
  constexpr float kA = kStep, kB = kStep + kSlant, kC = kStep + 2 * kSlant;
  static constexpr float kMaxAt[kPlane + 1][kPlane + 1] = {
      {kA, kA, kB, kC}, {kA, kA, kB, kC}, {kB, kB, kB, kC}, {kC, kC, kC, kC}};
  const std::ptrdiff_t step = std::ptrdiff_t (now_.step1 ());
  const float *now = now_.ptr<float> (edges.y) + edges.x + lane;
  const std::int32_t *colour = colour_.ptr<std::int32_t> (edges.y) + edges.x + lane;
  const F own = Lanes::at (now);
  const B own_colour = (B)Lanes::at (colour);
  /* Sums over members, in bits from 0, 8, 16 and from 0, 8, 20 on, with x = u + kPlane and
   * y = v + kPlane: 1, x, x x; y, y y, x y. */
  I along{}, across{};
  U bits{};
  for (int v = -kPlane; v <= kPlane; v++) {
    const int y = v + kPlane, far = std::abs (v);
#pragma GCC unroll 7
    for (int u = -kPlane; u <= kPlane; u++) {
      const int x = u + kPlane;
      const F d = Lanes::at (now + v * step + u);
      F off = d - own;
      Lanes::make_positive (off);
      const B there = (B)Lanes::at (colour + v * step + u);
      const U differs = (U)((own_colour > there ? own_colour : there) -
                            (own_colour < there ? own_colour : there)),
              pairs = (differs & 0xff00ff) + (differs >> 8 & 0xff00ff);
      const I sum = (I)(pairs + (pairs << 16)); /* in the upper half */
      const I member = (sum < (kAlike + 1) << 16) & (off <= kMaxAt[far][std::abs (u)]) & (d > 0);
      bits += bits - (U)member;
      along += member & (1 | x << 8 | x * x << 16);
      across += member & (y | y * y << 8 | x * y << 20);
    }
    if (v == 0) {
      Lanes::at (edges.members[0] + lane) = bits << (32 - (kPlane + 1) * kPlaneSide);
      bits = U{};
    }
  }
  Lanes::at (edges.members[1] + lane) = bits << (32 - kPlane * kPlaneSide);
  const I n = along & 255, x = along >> 8 & 255, y = across & 255, nine = kPlane * kPlane * n,
          sx = x - kPlane * n, sy = y - kPlane * n, sxx = (along >> 16) - 2 * kPlane * x + nine,
          syy = (across >> 8 & 0xfff) - 2 * kPlane * y + nine,
          sxy = (across >> 20) - kPlane * (x + y) + nine;
  const auto real = [] (const I &i) { return __builtin_convertvector(i, F); };
  const F count = real (n > 0 ? n : n + 1), mx = real (sx) / count, my = real (sy) / count,
          few = 0.02f * count, /* collinear pixels do not determine a plane */
      cxx = real (sxx) - real (sx) * mx + few, cyy = real (syy) - real (sy) * my + few,
          cxy = real (sxy) - real (sx) * my, det = cxx * cyy - cxy * cxy,
          right = (my * cxy - mx * cyy) / det, down = (mx * cxy - my * cxx) / det;
  Lanes::at (edges.count + lane) = count;
  Lanes::at (edges.at + lane) = 1 / count - mx * right - my * down;
  Lanes::at (edges.across + lane) = right;
  Lanes::at (edges.down + lane) = down;
}

/* From now_ to next_. Inside a surface, the plane's value is the mean. */
template <typename Lanes>
void
DisparityRefiner::smooth (const Part &part, Memory &m)
{
  using F = typename Lanes::F;
  const cv::Rect &at = part.at;
  WindowSums<kPlaneSide, float> sums (now_.ptr<float> (at.y - kPlane) + at.x - kPlane,
      std::ptrdiff_t (now_.step1 ()), at.width, m.sums);
  auto edges = part.edges.begin ();
  for (int y = at.y; y < at.br ().y; y++) {
    sums.next ();
    const float *now = now_.ptr<float> (y) + at.x;
    float *next = next_.ptr<float> (y) + at.x;
    for (int x = 0; x < at.width; x += Lanes::kLanes) {
      const float *threes = sums.threes () + x;
      F mean = (Lanes::at (threes) + Lanes::at (threes + 3) + Lanes::at (sums.columns () + x + 6)) *
               (1.f / (kPlaneSide * kPlaneSide));
      Lanes::keep_where (mean, Lanes::at (now + x) > 0);
      Lanes::at (next + x) = mean;
    }
    for (; edges != part.edges.end () && edges->y == y; edges++)
      for (int i = 0; i < kGroup; i += Lanes::kLanes)
        smooth_edges<Lanes> (*edges, i);
  }
}

template <typename Lanes>
void
DisparityRefiner::smooth_edges (const Edges &edges, int lane)
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  const std::ptrdiff_t step = std::ptrdiff_t (now_.step1 ());
  const float *now = now_.ptr<float> (edges.y) + edges.x + lane;
  const F own = Lanes::at (now), across = Lanes::at (edges.across + lane),
          down = Lanes::at (edges.down + lane);
  F sum{}, weight{}, row = Lanes::at (edges.at + lane) - float (kPlane) * (across + down);
  for_members<Lanes> (
      edges.members[0] + lane, edges.members[1] + lane, [&] (int u, int v, const I &mask) {
        if (u == -kPlane) {
          weight = row;
          row += down;
        }
        F off = (Lanes::at (now + v * step + u) - own) * weight;
        Lanes::keep_where (off, mask);
        sum += off;
        weight += across;
      });
  const F lowest = F{} + 1 / 16.f, value = own + sum;
  F &next = Lanes::at (next_.ptr<float> (edges.y) + edges.x + lane);
  next = Lanes::at (edges.is + lane) ? (value > lowest ? value : lowest) : next;
}

inline float *
DisparityRefiner::row_of (std::vector<float> &rows, int y, const Memory &m)
{
  return rows.data () + std::ptrdiff_t (y % kRows) * m.stride;
}

/* Makes room for the rows of a part; rows and columns without a disparity are 0. */
void
DisparityRefiner::begin_moves (const cv::Rect &at, Memory &m)
{
  const auto n = std::size_t (at.width + 2 * kPatch + 2 * kGroup); /* ends of groups and windows */
  m.stride = int (n);
  for (std::vector<float> *rows : {&m.slopes, &m.differences})
    rows->assign (n * kRows, 0);
  for (auto *sums : {&m.columns, &m.threes})
    for (std::vector<float> &sum : *sums)
      sum.assign (n, 0);
  m.left.assign (n, 0);
  m.valid.resize (n + kBytes);
  m.at.resize (n);
  m.greys.resize (n);
  m.shares.resize (n);
}

/* Grey level difference of the left image and the right one at next_, and the gradient of the right
 * one, of row y of the padded planes and kPatch pixels around. */
template <typename Lanes>
void
DisparityRefiner::compare_row (const Job &job, const cv::Rect &at, int y, Memory &m) const
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  const int n = at.width + 2 * kPatch, x0 = at.x - kPatch - kPad, row = y - kPad;
  float *slopes = row_of (m.slopes, y, m), *differences = row_of (m.differences, y, m);
  if (row < 0 || row >= job.left.rows) {
    std::fill_n (slopes, n, 0.f);
    std::fill_n (differences, n, 0.f);
    return;
  }
  const auto left = job.left.ptr<std::uint8_t> (row), right = job.right.ptr<std::uint8_t> (row);
  const int begin = std::max (0, -x0), end = std::min (n, job.left.cols - x0);
  float *__restrict levels = m.left.data ();
  for (int x = begin; x < end; x++)
    levels[x] = left[x0 + x];
  const float *disparity = next_.ptr<float> (y) + at.x - kPatch;
  const float origin = float (job.right_x + x0) - float (job.nearest - 1) * (1 / 16.f);
  const I first = I{} + 1, last = I{} + (job.right.cols - 3);
  const F zero{}, one = F{} + 1, most = F{} + kUnlike;
  F columns;
  count_lanes<Lanes> (columns);
  for (int x = 0; x < n; x += Lanes::kLanes, columns += float (Lanes::kLanes)) {
    const F there = origin + columns - Lanes::at (disparity + x);
    I to = __builtin_convertvector(there, I);
    to = to < last ? to : last;
    to = to > first ? to : first;
    F share = there - __builtin_convertvector(to, F);
    share = share > zero ? share : zero;
    Lanes::at (&m.at[std::size_t (x)]) = to;
    Lanes::at (&m.shares[std::size_t (x)]) = share < one ? share : one;
  }
  gather (right - 1, m.at.data (), n, m.greys.data ());
  for (int x = 0; x < n; x += Lanes::kLanes) {
    const I g = Lanes::at (&m.greys[std::size_t (x)]);
    F grey[4];
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++)
      grey[i] = __builtin_convertvector(g >> 8 * i & 255, F);
    const F f = Lanes::at (&m.shares[std::size_t (x)]);
    F slope = 0.5f * ((grey[2] - grey[0]) * (1 - f) + (grey[3] - grey[1]) * f),
      differs = Lanes::at (levels + x) - (grey[1] + f * (grey[2] - grey[1]));
    differs = differs > -most ? differs : -most;
    differs = differs < most ? differs : most;
    const I valid = Lanes::at (disparity + x) > zero;
    Lanes::keep_where (slope, valid);
    Lanes::keep_where (differs, valid);
    Lanes::at (slopes + x) = slope;
    Lanes::at (differences + x) = differs;
  }
}

/* Moves the sums over patches down by a row: row y comes in. */
template <typename Lanes>
void
DisparityRefiner::move_window (const cv::Rect &at, int y, Memory &m)
{
  using F = typename Lanes::F;
  const int n = at.width + 2 * kPatch, gone = y + kRows - kPatchSide;
  const float *slopes[] = {row_of (m.slopes, y, m), row_of (m.slopes, gone, m)},
              *differences[] = {row_of (m.differences, y, m), row_of (m.differences, gone, m)};
  for (int x = 0; x < n; x += Lanes::kLanes) {
    const F s = Lanes::at (slopes[0] + x), d = Lanes::at (differences[0] + x),
            old_s = Lanes::at (slopes[1] + x), old_d = Lanes::at (differences[1] + x);
    const auto move = [&] (int i, const F &old, const F &now) {
      F &sum = Lanes::at (&m.columns[i][std::size_t (x)]);
      sum = (sum - old) + now;
    };
    move (0, old_d * old_s, d * s);
    move (1, old_s * old_s, s * s);
    move (2, old_s, s);
    move (3, old_d, d);
  }
  for (int i = 0; i < 4; i++)
    add_threes (m.columns[i].data (), n, m.threes[i].data ());
}

/* From next_ to now_: see best_shift(). */
template <typename Lanes>
void
DisparityRefiner::move (const Job &job, const Part &part, Memory &m)
{
  using F = typename Lanes::F;
  const cv::Rect &at = part.at;
  begin_moves (at, m);
  const auto add_row = [&] (int y) {
    compare_row<Lanes> (job, at, y, m);
    move_window<Lanes> (at, y, m);
  };
  for (int y = at.y - kPatch; y < at.y + kPatch; y++)
    add_row (y);
  WindowSums<kPatchSide, std::uint8_t> valid (
      valid_.ptr<std::uint8_t> (at.y - kPatch) + at.x - kPatch, std::ptrdiff_t (valid_.step1 ()),
      at.width, m.counts);
  auto edges = part.edges.begin ();
  for (int y = at.y; y < at.br ().y; y++) {
    add_row (y + kPatch);
    valid.next ();
    count_row (valid.columns (), valid.threes (), at.width, m.valid.data ());
    const auto first = first_.ptr<float> (y) + at.x, disparity = next_.ptr<float> (y) + at.x;
    const auto to = now_.ptr<float> (y) + at.x;
    for (int x = 0; x < at.width; x += Lanes::kLanes) {
      F sums[4];
#pragma GCC unroll 4
      for (int i = 0; i < 4; i++) {
        const float *threes = m.threes[i].data () + x;
        sums[i] = Lanes::at (threes) + Lanes::at (threes + 3) + Lanes::at (threes + 6);
      }
      const F d = Lanes::at (disparity + x);
      F shift;
      find_shift<Lanes> (sums, Lanes::at (&m.valid[std::size_t (x)]), shift);
      F moved = d + shift;
      limit<Lanes> (Lanes::at (first + x), moved);
      Lanes::keep_where (moved, d > 0);
      Lanes::at (to + x) = moved;
    }
    for (; edges != part.edges.end () && edges->y == y; edges++)
      for (int i = 0; i < kGroup; i += Lanes::kLanes)
        move_edges<Lanes> (*edges, at, i, m);
  }
}

template <typename Lanes>
void
DisparityRefiner::move_edges (const Edges &edges, const cv::Rect &at, int lane, Memory &m)
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  F product{}, square{}, slope{}, difference{};
  const int column = edges.x - at.x + kPatch + lane;
  const float *slopes = nullptr, *differences = nullptr;
  for_members<Lanes> (
      edges.members[0] + lane, edges.members[1] + lane, [&] (int u, int v, const I &mask) {
        if (u == -kPlane) {
          slopes = row_of (m.slopes, edges.y + v, m) + column;
          differences = row_of (m.differences, edges.y + v, m) + column;
        }
        F s = Lanes::at (slopes + u), d = Lanes::at (differences + u);
        Lanes::keep_where (s, mask);
        Lanes::keep_where (d, mask);
        product += d * s;
        square += s * s;
        slope += s;
        difference += d;
      });
  const F sums[] = {product, square, slope, difference};
  F shift;
  find_shift<Lanes> (sums, Lanes::at (edges.count + lane), shift);
  const int x = edges.x + lane;
  F moved = Lanes::at (next_.ptr<float> (edges.y) + x) + shift,
    &to = Lanes::at (now_.ptr<float> (edges.y) + x);
  limit<Lanes> (Lanes::at (first_.ptr<float> (edges.y) + x), moved);
  to = Lanes::at (edges.is + lane) ? moved : to;
}

void
DisparityRefiner::put_back (const Job &job, const cv::Rect &part, cv::Mat &disparity) const
{
  for (int y = part.y; y < part.br ().y; y++) {
    auto to = disparity.ptr<std::int16_t> (y - kPad) + part.x - kPad;
    const auto d = next_.ptr<float> (y) + part.x;
    for (int x = 0; x < part.width; x++) {
      const int refined = std::max (int (16 * d[x] + 0.5f), 1) + job.nearest - 1;
      to[x] = d[x] > 0 ? std::int16_t (std::min (refined, 32767)) : to[x];
    }
  }
}

void
DisparityRefiner::apply (const Job &job, const Tiles &tiles, cv::Mat &disparity)
{
  if (job.right.cols < 4)
    return;
  begin (disparity.size (), tiles);
  const auto each = [&] (const auto &work) {
    in_parallel (parts_.size (), tiles.n_threads (), [&] (std::size_t i, std::size_t worker) {
      if (parts_[i].at.empty ())
        return;
      for_this_cpu ([&, &memory = memory_.of (worker)]<typename Lanes> (
                        const Lanes &lanes) { work (parts_[i], memory, lanes); });
    });
  };
  const auto smooth_all = [&] {
    each ([&]<typename Lanes> (
              const Part &part, Memory &m, const Lanes &) { smooth<Lanes> (part, m); });
  };
  each ([&] (Part &part, Memory &, const auto &) { load (job, disparity, part.at); });
  each ([&] (const Part &part, Memory &, const auto &) { mark_steps (part.at); });
  each (
      [&]<typename Lanes> (Part &part, Memory &m, const Lanes &) { find_edges<Lanes> (part, m); });
  smooth_all ();
  for (int i = 0; i < kIterations; i++) {
    each ([&]<typename Lanes> (
              const Part &part, Memory &m, const Lanes &) { move<Lanes> (job, part, m); });
    smooth_all ();
  }
  each ([&] (const Part &part, Memory &, const auto &) { put_back (job, part.at, disparity); });
}

} // namespace rangecast
