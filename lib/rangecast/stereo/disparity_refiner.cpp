/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Windows of 7 x 7 pixels are summed in OpenCV's vectors of fixed width (bytes for colours, four
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
  /** @param first   column and row of the first window
   *  @param width   windows in a row
   *  @param columns scratch memory; @param[out] sums  those of the row, after next() */
  WindowSums (const cv::Mat &from, const cv::Point &first, int width, std::vector<T> &columns,
      std::vector<T> &sums)
      : from_ (from), x_ (first.x), y_ (first.y), n_ (width + kSide - 1)
  {
    columns.assign (std::size_t (n_), 0);
    sums.resize (std::size_t (n_));
    columns_ = columns.data ();
    sums_ = sums.data ();
    for (int k = 0; k < kSide - 1; k++)
      add (y_ + k);
  }
  void next ()
  {
    add (y_ + kSide - 1);
    /* Sums of two, four and eight columns, as needed. */
    std::copy_n (columns_, n_, sums_);
    constexpr int kPower = int (std::bit_floor (unsigned (kSide)));
    for (int reach = 1; reach < kPower; reach *= 2)
      for (int x = 0; x < n_ - reach; x++)
        sums_[x] = T (sums_[x] + sums_[x + reach]);
    static_assert (kSide - kPower <= 3);
    const int last = n_ - kSide + 1;
    for (int x = 0; x < last; x++) {
      T sum = sums_[x];
      for (int k = kPower; k < kSide; k++)
        sum = T (sum + columns_[x + k]);
      sums_[x] = sum;
    }
    const T *gone = from_.ptr<T> (y_++) + x_;
    for (int x = 0; x < n_; x++)
      columns_[x] = T (columns_[x] - gone[x]);
  }

private:
  void add (int y)
  {
    const T *row = from_.ptr<T> (y) + x_;
    for (int x = 0; x < n_; x++)
      columns_[x] = T (columns_[x] + row[x]);
  }
  const cv::Mat &from_;
  const int x_;
  int y_;
  const int n_;
  T *columns_, *sums_;
};

/* One bit per neighbour, eight per row, of which the last is unused. */
using Members = std::uint64_t;
constexpr int kLanes = 2 * kPlane + 2;
static_assert (kLanes == 8 && kPlane == 3);
using Floats = cv::v_float32x4;

/* Masks for a row of members, left and right half: all bits or none. */
struct Choice {
  Floats half[2];
  Choice (Members members, int v)
  {
    alignas (16) static constexpr int kBits[kLanes] = {1, 2, 4, 8, 16, 32, 64, 128};
    const cv::v_int32x4 row = cv::v_setall_s32 (int (members >> (8 * (v + kPlane)) & 255)),
                        low = cv::v_load_aligned (kBits), high = cv::v_load_aligned (kBits + 4);
    half[0] = cv::v_reinterpret_as_f32 ((row & low) == low);
    half[1] = cv::v_reinterpret_as_f32 ((row & high) == high);
  }
};

/* The shift that minimizes the difference between both images, without its mean: cameras may differ
 * in brightness. From sums over n pixels. */
inline float
best_shift (float product, float square, float slope, float difference, float n)
{
  const float mean = slope / n,
              by = -(product - mean * difference) / (square - mean * slope + kDull);
  return std::min (std::max (by, -kMax), kMax);
}

} // namespace

void
DisparityRefiner::begin (const Job &job, const cv::Size &size, const Tiles &tiles)
{
  const cv::Size all (size.width + 2 * kPad + 8, size.height + 2 * kPad); /* 8: ends of vectors */
  for (cv::Mat *m : {&first_, &now_, &next_, &products_, &squares_, &slopes_, &differences_}) {
    m->create (all, CV_32F);
    m->setTo (0);
  }
  steps_.create (all, CV_8U);
  steps_.setTo (1);
  valid_.create (all, CV_8U);
  valid_.setTo (0);
  for (cv::Mat &plane : colours_) {
    plane.create (all, CV_8U);
    plane.setTo (0);
  }
  const cv::Mat &colour = job.colour;
  for (int y = 0; y < colour.rows; y++) {
    const auto from = colour.ptr<std::uint8_t> (y);
    for (int c = 0; c < 3; c++) {
      auto to = colours_[c].ptr<std::uint8_t> (y + kPad) + kPad;
      for (int x = 0; x < colour.cols; x++)
        to[x] = from[4 * x + c];
    }
  }
  members_.assign (std::size_t (all.width) * std::size_t (all.height), 0);
  parts_ = tiles.tiles ();
  memory_.reserve (tiles.workers ());
}

/* Copies a part of the image and shrinks it to the columns with disparities. From then on parts are
 * in the coordinates of the padded planes. */
void
DisparityRefiner::load (const Job &job, const cv::Mat &disparity, cv::Rect &part)
{
  int begin = part.width, end = 0;
  for (int y = 0; y < part.height; y++) {
    const auto d = disparity.ptr<std::int16_t> (part.y + y) + part.x;
    auto first = first_.ptr<float> (part.y + y + kPad) + part.x + kPad,
         now = now_.ptr<float> (part.y + y + kPad) + part.x + kPad;
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

/* The least-squares plane through a pixel's surface, evaluated at the pixel. */
float
DisparityRefiner::on_plane (int x, int y, Members members) const
{
  const float own = now_.ptr<float> (y)[x];
  const Floats centre = cv::v_setall_f32 (own), zero = cv::v_setzero_f32 (),
               one = cv::v_setall_f32 (1);
  Floats count[2] = {zero, zero}, count_y[2] = {zero, zero}, count_yy[2] = {zero, zero},
         off[2] = {zero, zero}, off_y[2] = {zero, zero}; /* by column */
  for (int v = -kPlane; v <= kPlane; v++) {
    const Choice choice (members, v);
    const Floats row = cv::v_setall_f32 (float (v));
    for (int k = 0; k < 2; k++) {
      const Floats w = choice.half[k] & one,
                   e = choice.half[k] &
                       (cv::v_load (now_.ptr<float> (y + v) + x - kPlane + 4 * k) - centre),
                   wy = row * w;
      count[k] += w;
      off[k] += e;
      count_y[k] += wy;
      count_yy[k] = cv::v_muladd (row, wy, count_yy[k]);
      off_y[k] = cv::v_muladd (row, e, off_y[k]);
    }
  }
  const Floats u[2] = {Floats (-3, -2, -1, 0), Floats (1, 2, 3, 4)};
  const auto sum = [] (const Floats (&l)[2]) { return cv::v_reduce_sum (l[0] + l[1]); };
  const auto sum_x = [&u] (const Floats (&l)[2]) {
    return cv::v_reduce_sum (u[0] * l[0] + u[1] * l[1]);
  };
  const float n = sum (count), sx = sum_x (count), sy = sum (count_y), sd = sum (off),
              sxx = cv::v_reduce_sum (u[0] * u[0] * count[0] + u[1] * u[1] * count[1]),
              sxy = sum_x (count_y), syy = sum (count_yy), sxd = sum_x (off), syd = sum (off_y);
  const float mx = sx / n, my = sy / n, md = sd / n;
  const float few = 0.02f * n; /* collinear pixels do not determine a plane */
  const float cxx = sxx - sx * mx + few, cyy = syy - sy * my + few, cxy = sxy - sx * my,
              cxd = sxd - sx * md, cyd = syd - sy * md, det = cxx * cyy - cxy * cxy;
  return own + md - (mx * (cxd * cyy - cyd * cxy) + my * (cyd * cxx - cxd * cxy)) / det;
}

/* For pixels near a step. */
void
DisparityRefiner::choose_members (const cv::Rect &part, Memory &m)
{
  constexpr int kSide = 2 * kPlane + 1;
  const cv::Point first (part.x - kPlane, part.y - kPlane);
  WindowSums<kSide, std::uint8_t> steps (steps_, first, part.width, m.steps[0], m.steps[1]);
  for (int y = part.y; y < part.br ().y; y++) {
    steps.next ();
    const auto now = now_.ptr<float> (y) + part.x;
    Members *members = members_.data () + std::size_t (y) * std::size_t (now_.cols) + part.x;
    for (int x = 0; x < part.width; x++)
      members[x] = now[x] > 0 && m.steps[1][std::size_t (x)] != 0 ? members_of (part.x + x, y) : 0;
  }
}

/* From now_ to next_. Inside a surface, the plane's value is the mean. */
void
DisparityRefiner::smooth (const cv::Rect &part, Memory &m)
{
  constexpr int kSide = 2 * kPlane + 1;
  const cv::Point first (part.x - kPlane, part.y - kPlane);
  WindowSums<kSide, float> sums (now_, first, part.width, m.columns[0], m.sums[0]);
  for (int y = part.y; y < part.br ().y; y++) {
    sums.next ();
    const auto now = now_.ptr<float> (y) + part.x;
    auto next = next_.ptr<float> (y) + part.x;
    const Members *members = members_.data () + std::size_t (y) * std::size_t (now_.cols) + part.x;
    for (int x = 0; x < part.width; x++)
      next[x] = now[x] > 0 ? m.sums[0][std::size_t (x)] * (1.f / (kSide * kSide)) : 0;
    for (int x = 0; x < part.width; x++)
      if (members[x] != 0)
        next[x] = std::max (on_plane (part.x + x, y, members[x]), 1 / 16.f);
  }
}

/* Grey level difference of the left image and the right one at next_, and the gradient of the right
 * one. */
void
DisparityRefiner::compare (const Job &job, const cv::Rect &part, Memory &m)
{
  const auto n = std::size_t (part.width);
  m.at.resize (n);
  m.greys.resize (n);
  m.sums[0].resize (n + 2 * kPad);
  std::int32_t *at = m.at.data ();
  float *shares = m.sums[0].data ();
  const std::int32_t last = job.right.cols - 3;
  const float origin = float (job.right_x + part.x - kPad) - float (job.nearest - 1) * (1 / 16.f);
  for (int y = part.y; y < part.br ().y; y++) {
    const auto left = job.left.ptr<std::uint8_t> (y - kPad) + part.x - kPad,
               right = job.right.ptr<std::uint8_t> (y - kPad);
    const auto d = next_.ptr<float> (y) + part.x;
    auto products = products_.ptr<float> (y) + part.x, squares = squares_.ptr<float> (y) + part.x,
         slopes = slopes_.ptr<float> (y) + part.x,
         differences = differences_.ptr<float> (y) + part.x;
    for (std::int32_t x = 0; x < part.width; x++) {
      const float there = origin + float (x) - d[x];
      at[x] = std::clamp (std::int32_t (there), std::int32_t{1}, last);
      shares[x] = std::min (std::max (there - float (at[x]), 0.f), 1.f);
    }
    for (std::size_t x = 0; x < n; x++)
      std::memcpy (&m.greys[x], right + at[x] - 1, 4);
    for (int x = 0; x < part.width; x++) {
      const std::uint32_t g = m.greys[std::size_t (x)];
      const auto g0 = float (int (g >> kByte[0] & 255)), g1 = float (int (g >> kByte[1] & 255)),
                 g2 = float (int (g >> kByte[2] & 255)), g3 = float (int (g >> kByte[3] & 255));
      const float f = shares[x], slope = 0.5f * ((g2 - g0) * (1 - f) + (g3 - g1) * f),
                  differs = float (left[x]) - (g1 + f * (g2 - g1));
      const float counts = d[x] > 0 ? slope : 0;
      differences[x] = d[x] > 0 ? std::min (std::max (differs, -kUnlike), kUnlike) : 0;
      slopes[x] = counts;
      products[x] = differences[x] * counts;
      squares[x] = counts * counts;
    }
  }
}

float
DisparityRefiner::shift_of_members (int x, int y, Members members) const
{
  const cv::Mat *const planes[] = {&products_, &squares_, &slopes_, &differences_};
  const Floats zero = cv::v_setzero_f32 ();
  Floats sums[4] = {zero, zero, zero, zero};
  for (int v = -kPlane; v <= kPlane; v++) {
    const Choice choice (members, v);
    for (int i = 0; i < 4; i++) {
      const float *row = planes[i]->ptr<float> (y + v) + x - kPlane;
      sums[i] += (choice.half[0] & cv::v_load (row)) + (choice.half[1] & cv::v_load (row + 4));
    }
  }
  return best_shift (cv::v_reduce_sum (sums[0]), cv::v_reduce_sum (sums[1]),
      cv::v_reduce_sum (sums[2]), cv::v_reduce_sum (sums[3]), float (std::popcount (members)));
}

/* From next_ to now_: see best_shift(). */
void
DisparityRefiner::move (const cv::Rect &part, Memory &m)
{
  constexpr int kSide = 2 * kPatch + 1;
  const cv::Point begin (part.x - kPatch, part.y - kPatch);
  using Sums = WindowSums<kSide, float>;
  Sums sums[] = {{products_, begin, part.width, m.columns[0], m.sums[0]},
      {squares_, begin, part.width, m.columns[1], m.sums[1]},
      {slopes_, begin, part.width, m.columns[2], m.sums[2]},
      {differences_, begin, part.width, m.columns[3], m.sums[3]}};
  m.shifts.resize (std::size_t (part.width));
  WindowSums<kSide, std::uint8_t> counts (valid_, begin, part.width, m.steps[0], m.steps[1]);
  for (int y = part.y; y < part.br ().y; y++) {
    for (Sums &s : sums)
      s.next ();
    counts.next ();
    const float *product = m.sums[0].data (), *square = m.sums[1].data (),
                *slope = m.sums[2].data (), *difference = m.sums[3].data ();
    const std::uint8_t *count = m.steps[1].data ();
    float *shift = m.shifts.data ();
    const auto first = first_.ptr<float> (y) + part.x, d = next_.ptr<float> (y) + part.x;
    auto to = now_.ptr<float> (y) + part.x;
    const Members *members = members_.data () + std::size_t (y) * std::size_t (now_.cols) + part.x;
    for (int x = 0; x < part.width; x++)
      shift[x] = best_shift (
          product[x], square[x], slope[x], difference[x], float (std::max<int> (count[x], 1)));
    for (int x = 0; x < part.width; x++)
      if (members[x] != 0)
        shift[x] = shift_of_members (part.x + x, y, members[x]);
    for (int x = 0; x < part.width; x++) {
      const float moved = d[x] + shift[x], low = std::max (first[x] - kMaxOfAll, 1 / 16.f),
                  high = first[x] + kMaxOfAll;
      to[x] = d[x] > 0 ? std::min (std::max (moved, low), high) : 0;
    }
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
  begin (job, disparity.size (), tiles);
  const auto each = [&] (const auto &work) {
    in_parallel (parts_.size (), tiles.n_threads (), [&] (std::size_t i, std::size_t worker) {
      for_this_cpu ([&, &memory = memory_.of (worker)] { work (parts_[i], memory); });
    });
  };
  each ([&] (cv::Rect &part, Memory &) { load (job, disparity, part); });
  std::erase_if (parts_, [] (const cv::Rect &part) { return part.empty (); });
  each ([&] (const cv::Rect &part, Memory &) { mark_steps (part); });
  each ([&] (const cv::Rect &part, Memory &m) { choose_members (part, m); });
  each ([&] (const cv::Rect &part, Memory &m) { smooth (part, m); });
  for (int i = 0; i < job.iterations; i++) {
    each ([&] (const cv::Rect &part, Memory &m) { compare (job, part, m); });
    each ([&] (const cv::Rect &part, Memory &m) { move (part, m); });
    each ([&] (const cv::Rect &part, Memory &m) { smooth (part, m); });
  }
  each ([&] (const cv::Rect &part, Memory &) { put_back (job, part, disparity); });
}

} // namespace rangecast
