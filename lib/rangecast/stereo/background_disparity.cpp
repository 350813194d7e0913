/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "background_disparity.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace rangecast {
namespace {

constexpr std::int16_t kUnknown = -32768, kHidden = -32767;
constexpr int kRadius = 2, kArea = 25; /* of a patch, pixels */
/* Difference of a pixel that is noise, or of a patch in the mean, grey levels; as a sum over one.
 */
constexpr int kNoise = 3, kNoiseSum = kNoise * kArea + kArea / 2;

/* Fills unknown pixels of a row with the farther one of the neighbouring disparities. */
void
guess_row (std::int16_t *row, int width)
{
  for (int x = 0; x < width;) {
    if (row[x] > kHidden) {
      x++;
      continue;
    }
    int end = x;
    while (end < width && row[end] <= kHidden)
      end++;
    std::int16_t guess = kUnknown;
    if (x > 0 && end < width)
      guess = std::min (row[x - 1], row[end]);
    else if (x > 0 || end < width)
      guess = x > 0 ? row[x - 1] : row[end];
    std::fill (row + x, row + end, guess);
    x = end;
  }
}

} // namespace

/* Marks pixels without disparity next to the background as hidden from one camera. */
void
BackgroundDisparity::mark_hidden (
    const std::int16_t *d, const std::uint8_t *grey, int y, int min, int far)
{
  auto known = known_.ptr<std::int16_t> (y);
  auto picture = picture_.ptr<std::uint8_t> (y);
  const int width = known_.cols;
  const auto is_background = [&] (int x) {
    return x >= 0 && x < width && d[x] >= min && d[x] < far;
  };
  for (int x = 0; x < width;) {
    if (d[x] >= min) {
      x++;
      continue;
    }
    const int begin = x;
    while (x < width && d[x] < min)
      x++;
    if (!is_background (begin - 1) && !is_background (x))
      continue;
    for (int i = begin; i < x; i++)
      if (known[i] <= kHidden) {
        known[i] = kHidden;
        picture[i] = grey[i];
      }
  }
}

void
BackgroundDisparity::remember (const cv::Mat &grey, const cv::Mat &disparity, int min, int far)
{
  if (known_.size () != grey.size ()) {
    known_.create (grey.size (), CV_16S);
    known_.setTo (kUnknown);
    grey.copyTo (picture_);
  }
  for (int y = 0; y < grey.rows; y++) {
    const auto d = disparity.ptr<std::int16_t> (y);
    const auto g = grey.ptr<std::uint8_t> (y);
    auto known = known_.ptr<std::int16_t> (y);
    auto picture = picture_.ptr<std::uint8_t> (y);
    for (int x = 0; x < grey.cols; x++)
      if (d[x] >= min && d[x] < far) {
        known[x] = d[x];
        picture[x] = g[x];
      } else if (d[x] >= far && known[x] == kHidden)
        known[x] = kUnknown;
    mark_hidden (d, g, y, min, far);
  }
  known_.copyTo (likely_);
  for (int y = 0; y < grey.rows; y++)
    guess_row (likely_.ptr<std::int16_t> (y), grey.cols);
}

void
BackgroundDisparity::find_still (const cv::Mat &left, const cv::Point &at, cv::Mat &still) const
{
  const cv::Rect part (at, left.size ());
  cv::absdiff (left, picture_ (part), still);
  cv::compare (still, kNoise, still, cv::CMP_LE);
  still.setTo (0, known_ (part) == kUnknown);
}

void
BackgroundDisparity::extend (
    const cv::Point &at, int min, int far, const Tiles &tiles, cv::Mat &disparity) const
{
  constexpr std::int16_t kNothing = 32767;
  tiles.each ([&] (const cv::Rect &tile, std::size_t) {
    for (int y = tile.y; y < tile.br ().y; y++) {
      auto d = disparity.ptr<std::int16_t> (y);
      const auto back = likely_.ptr<std::int16_t> (at.y + y) + at.x;
      /* Whether the pixels next to the tile are known background. */
      const auto beside = [&] (int x) {
        const bool inside = at.x + x >= 0 && at.x + x < likely_.cols;
        return inside && back[x] > kHidden ? back[x] : kNothing;
      };
      for (int x = tile.x; x < tile.br ().x;) {
        if (d[x] >= min) {
          x++;
          continue;
        }
        const int begin = x;
        while (x < tile.br ().x && d[x] < min)
          x++;
        const std::int16_t farther = std::min (begin > tile.x ? d[begin - 1] : beside (begin - 1),
            x < tile.br ().x ? d[x] : beside (x));
        if (farther >= min && farther < far)
          std::fill (d + begin, d + x, static_cast<std::int16_t> (min));
      }
    }
  });
}

namespace {

/* Of the patches of a row, sums: difference between both images at the disparity and at the
 * background's, contrast, difference from the picture in which the background was seen. */
struct RowCosts {
  const std::int16_t *own, *other, *contrast, *change;
};

/* Replaces disparities by the background's, and clears those of pixels that the right camera does
 * not see.
 * @param back, seen     the background's disparities, likely and known
 * @param[out] restored  1 = replaced, else 0 */
void
choose_background (const RowCosts &costs, const std::int16_t *__restrict back,
    const std::int16_t *__restrict seen, int min, int none, int n, std::int16_t *__restrict d,
    std::uint8_t *__restrict restored)
{
  const std::int16_t *__restrict own = costs.own, *__restrict other = costs.other,
                                 *__restrict contrast = costs.contrast,
                                 *__restrict change = costs.change;
  for (int x = 0; x < n; x++) {
    const std::int16_t behind = back[x]; /* not loaded by condition, so that vectors are */
    const bool still = (seen[x] != kUnknown) & (change[x] <= kNoiseSum),
               fits = (behind != kUnknown) & (other[x] <= kNoiseSum + contrast[x] / 2),
               better = (d[x] < min) | (other[x] + kNoise * kArea < own[x]),
               hidden = still & (seen[x] == kHidden), background = fits & (still | better);
    const auto kept = static_cast<std::int16_t> (d[x] < min ? none : d[x]);
    const std::int16_t visible = background ? behind : kept;
    d[x] = hidden ? static_cast<std::int16_t> (none) : visible;
    restored[x] = background & !hidden;
  }
}

/* Columns of the right image that pixels match.
 * @param x0  that of the first pixel, with disparity 0 */
void
find_right (const std::int16_t *__restrict d, int x0, int right_width, int n,
    std::int16_t *__restrict there)
{
  for (int x = 0; x < n; x++)
    there[x] =
        static_cast<std::int16_t> (std::clamp (x0 + x - ((d[x] + 8) >> 4), 0, right_width - 1));
}

void
clear_claimed (const std::int16_t *__restrict own, const std::int16_t *__restrict claimed, int min,
    int none, int n, std::int16_t *__restrict d)
{
  for (int x = 0; x < n; x++) {
    const std::int16_t kept = d[x];
    d[x] = (kept >= min) & (claimed[x] < own[x]) ? static_cast<std::int16_t> (none) : kept;
  }
}

} // namespace

/* Compares patches of both images where there is a disparity. memory.grey is the left image. @param
 * disparity  of the size of job.left */
void
BackgroundDisparity::compare (const Job &job, const cv::Rect &tile, const cv::Mat &disparity,
    int min, Memory &m, Plane &unlike) const
{
  const int x0 = tile.x - kRadius, y0 = tile.y - kRadius;
  const auto lowest = static_cast<std::int16_t> (min);
  m.pixels.set_size (tile.width + 2 * kRadius, tile.height + 2 * kRadius);
  const int width = m.pixels.width (), begin = std::max (0, -x0),
            end = std::min (width, disparity.cols - x0);
  for (int y = 0; y < m.pixels.height (); y++) {
    const int row = std::clamp (y0 + y, 0, disparity.rows - 1);
    const auto d = disparity.ptr<std::int16_t> (row) + x0;
    const std::int16_t *l = m.grey.row (y + kRadius) + kRadius;
    std::int16_t *out = m.pixels.row (y);
    look_up (d + begin, end - begin, job.right.ptr<std::uint8_t> (row), job.right.cols,
        x0 + begin + job.right_x, out + begin);
    for (int x = begin; x < end; x++) {
      const auto unlike_here = static_cast<std::int16_t> (std::abs (l[x] - out[x]));
      out[x] = d[x] < lowest ? std::int16_t{255} : unlike_here;
    }
    std::fill (out, out + begin, out[begin]);
    std::fill (out + end, out + width, out[end - 1]);
  }
  sum_windows<kRadius> (m.pixels, unlike, m.columns);
}

/* Restores row y of the part (row i of the tile), from column x on. */
void
BackgroundDisparity::restore_row (
    const Job &job, int x0, int y, int i, int width, Memory &m, std::int16_t *d) const
{
  const RowCosts costs = {m.own.row (i), m.other.row (i), m.contrast.row (i), m.change.row (i)};
  const auto n = std::size_t (width);
  m.restored.resize (n);
  m.there.resize (n);
  m.claimed.resize (n);
  choose_background (costs, likely_.ptr<std::int16_t> (job.at.y + y) + job.at.x + x0,
      known_.ptr<std::int16_t> (job.at.y + y) + job.at.x + x0, job.min, job.none, width, d,
      m.restored.data ());
  const std::uint8_t *restored = m.restored.data ();
  const auto next = [restored, width] (int x) {
    const void *found = std::memchr (restored + x, 1, std::size_t (width - x));
    return found ? int (static_cast<const std::uint8_t *> (found) - restored) : width;
  };
  const int first = next (0);
  if (first == width)
    return;
  std::int16_t *there = m.there.data (), *claimed = m.claimed.data ();
  find_right (d, x0 + job.right_x, job.right.cols, width, there);
  m.claims.assign (std::size_t (job.right.cols), 32767);
  std::int16_t *claims = m.claims.data ();
  for (int x = first; x < width; x = next (x + 1))
    claims[there[x]] = std::min (claims[there[x]], costs.other[x]);
  /* A right pixel that matches the background better cannot match something else as well. */
  for (int x = 0; x < width; x++)
    claimed[x] = claims[there[x]];
  clear_claimed (costs.own, claimed, job.min, job.none, width, d);
}

void
BackgroundDisparity::restore_tile (
    const Job &job, const cv::Rect &tile, const cv::Mat &disparity, Memory &m, cv::Mat &to) const
{
  const cv::Rect part (job.at, job.left.size ());
  cut_grey (job.left, tile, 2 * kRadius, m.grey);
  differ_from_mean<kRadius> (m.grey, m.pixels, m.sums, m.columns);
  sum_windows<kRadius> (m.pixels, m.contrast, m.columns);
  compare (job, tile, disparity, job.min, m, m.own);
  compare (job, tile, likely_ (part), kHidden + 1, m, m.other);
  cut_grey (picture_ (part), tile, kRadius, m.before);
  m.pixels.set_size (m.before.width (), m.before.height ());
  for (int y = 0; y < m.pixels.height (); y++) {
    const std::int16_t *now = m.grey.row (y + kRadius) + kRadius, *before = m.before.row (y);
    std::int16_t *out = m.pixels.row (y);
    for (int x = 0; x < m.pixels.width (); x++)
      out[x] = static_cast<std::int16_t> (std::abs (now[x] - before[x]));
  }
  sum_windows<kRadius> (m.pixels, m.change, m.columns);
  for (int i = 0; i < tile.height; i++) {
    auto out = to.ptr<std::int16_t> (tile.y + i) + tile.x;
    std::copy_n (disparity.ptr<std::int16_t> (tile.y + i) + tile.x, tile.width, out);
    restore_row (job, tile.x, tile.y + i, i, tile.width, m, out);
  }
}

void
BackgroundDisparity::restore (const cv::Mat &left, const cv::Mat &right, int right_x,
    const cv::Point &at, int min, int none, const Tiles &tiles, const cv::Mat &disparity,
    cv::Mat &to)
{
  const Job job = {left, right, right_x, at, min, none};
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    restore_tile (job, tile, disparity, memory_.of (worker), to);
  });
}

} // namespace rangecast
