/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "motion.hpp"

#include <algorithm>
#include <cmath>

#include "../../base/simd.hpp"
#include "pixel_key.hpp"

namespace rangecast {
namespace {

/* A pixel between four, upper left, upper right, lower left and lower right, at so many quarters to
 * the right and down: mixes them if all are valid and their depths are close to the first one's,
 * and else takes the nearest. */
[[gnu::always_inline]] inline Components
mix (const Components (&taps)[4], int right, int down, std::int32_t max_gap)
{
  const auto near = [&] (int i) { return std::abs (taps[i][0] - taps[0][0]) <= max_gap; };
  if (!((taps[0] | taps[1] | taps[2] | taps[3])[1] >= 0 && near (1) && near (2) && near (3)))
    return taps[(right >= 2) + 2 * (down >= 2)];
  const Components upper = 4 * taps[0] + right * (taps[1] - taps[0]);
  const Components lower = 4 * taps[2] + right * (taps[3] - taps[2]);
  return (4 * upper + down * (lower - upper) + 8) >> 4;
}

/* Pixels of a block's row. */
[[gnu::always_inline]] inline void
fetch_part (const ReferencePlane &plane, int x, int y, const BlockMotion &m,
    const MotionScale &scale, std::span<PixelCode> to)
{
  const int right = m.dx & 3, down = m.dy & 3;
  PixelCode rows[2][kMotionBlock + 2] = {};
  const int left = x + (m.dx >> 2), top = y + (m.dy >> 2);
  for (int i = 0; i < 1 + (down > 0); i++)
    plane.fetch (left, top + i, std::span (rows[i]).first (to.size () + 1), kEmptyPixel);
  const PixelCode *const upper = rows[0], *const lower = rows[down > 0];
  const std::size_t next = right > 0;
  for (std::size_t i = 0; i < to.size (); i++) {
    const PixelCode codes[] = {upper[i], upper[i + next], lower[i], lower[i + next]};
    Components taps[4];
    std::ranges::transform (codes, taps, components_of);
    const Components mixed = mix (taps, right, down, scale.max_gap);
    const bool unknown = std::ranges::find (codes, kNoPixel) != std::end (codes);
    to[i] = unknown || mixed[1] < 0 ? kNoPixel : pack_components (mixed);
  }
}

} // namespace

bool
is_sound (const BlockMotion &m, const MotionScale &scale)
{
  return std::abs (m.dx) <= kMaxMotion && std::abs (m.dy) <= kMaxMotion &&
         std::abs (m.dz) <= kMaxMotionDepth / scale.unit &&
         std::abs (m.slope_x) <= kMaxMotionSlope && std::abs (m.slope_y) <= kMaxMotionSlope;
}

void
fetch_displaced (const ReferencePlane &plane, int x, int y, std::span<const BlockMotion> motions,
    const MotionScale &scale, int first_y, int end_y, std::span<PixelCode> to)
{
  const int end = x + static_cast<int> (to.size ()), line = y % kMotionBlock;
  for (const BlockMotion &m : motions) {
    const int next = std::min ((x / kMotionBlock + 1) * kMotionBlock, end);
    const auto part = to.first (static_cast<std::size_t> (next - x));
    to = to.subspan (part.size ());
    const int top = y + (m.dy >> 2);
    if (top < first_y || top + ((m.dy & 3) > 0) >= end_y)
      std::ranges::fill (part, kNoPixel);
    else
      for_this_cpu ([&] { fetch_part (plane, x, y, m, scale, part); });
    if (m != BlockMotion{m.dx, m.dy})
      for (int i = 0; i < next - x; i++) {
        PixelCode &code = part[static_cast<std::size_t> (i)];
        const auto depth = static_cast<std::int32_t> (code & 0xffff) +
                           depth_offset (m, scale, (x + i) % kMotionBlock, line);
        const auto moved = (code & ~PixelCode{0xffff}) |
                           static_cast<PixelCode> (std::clamp (depth, 0, scale.last_depth));
        code = code == kNoPixel ? code : moved;
      }
    x = next;
  }
}

void
MotionMemory::resize (int width, int height)
{
  across_ = motion_blocks (0, width);
  now_.assign (across_ * motion_blocks (0, height), BlockMotion{});
  before_ = now_;
}

MotionSearch::MotionSearch ()
{
  samples_.reserve (kMotionBlock * kMotionBlock);
  pairs_.reserve (kMotionBlock * kMotionBlock);
  sorted_.reserve (kMotionBlock * kMotionBlock);
}

/* Every second pixel of every second row, or all pixels of small blocks. */
void
MotionSearch::collect_samples (const Pictures &pictures, const Area &area)
{
  const ConstRangeImage &image = pictures.image;
  const ColourQuantiser &colour = pictures.colour;
  samples_.clear ();
  const int step = area.width >= 8 && area.height >= 8 ? 2 : 1;
  for (int y = area.y; y < area.y + area.height; y += step) {
    const std::uint16_t *z = image.depth.row (y - image.roi.y) - image.roi.x;
    const Rgbx *c = image.colour.row (y - image.roi.y) - image.roi.x;
    for (int x = area.x; x < area.x + area.width; x += step)
      if (pictures.depth.valid (z[x])) {
        const Components own = {pictures.depth.code (z[x]), colour.code (c[x].r),
            colour.code (c[x].g), colour.code (c[x].b)};
        samples_.push_back ({components_of_key (key_of (own)), x, y});
      }
  }
}

/* The pixels that a motion in x and y gives the samples. */
void
MotionSearch::pair_up (const Pictures &pictures, const Area &area, const BlockMotion &m)
{
  pairs_.clear ();
  const ReferencePlane &before = pictures.before;
  const int right = m.dx & 3, down = m.dy & 3, next = right > 0, below = down > 0;
  const int left = m.dx >> 2, top = m.dy >> 2;
  for (const Sample &s : samples_) {
    const int x = s.x + left, y = s.y + top;
    if (y < area.first_y || y + below >= area.end_y)
      continue;
    Components taps[4];
    for (int t = 0; t < 4; t++)
      taps[t] = components_of (before.at (x + (t & 1 & next), y + (t >> 1 & below)));
    const Components mixed = mix (taps, right, down, pictures.scale.max_gap);
    if (mixed[1] < 0)
      continue;
    const Components difference = s.own - mixed;
    const FloatComponents error = __builtin_convertvector(difference, FloatComponents);
    const FloatComponents squares = error * error * colour_weights_;
    pairs_.push_back ({s.x % kMotionBlock, s.y % kMotionBlock, difference[0],
        squares[1] + squares[2] + squares[3]});
  }
}

std::int32_t
MotionSearch::median_depth ()
{
  constexpr std::size_t kEnough = 16; /* pairs */
  const std::size_t step = std::max<std::size_t> (pairs_.size () / kEnough, 1);
  sorted_.clear ();
  for (std::size_t i = 0; i < pairs_.size (); i += step)
    sorted_.push_back (pairs_[i].depth);
  const auto middle = sorted_.begin () + static_cast<std::ptrdiff_t> (sorted_.size () / 2);
  std::ranges::nth_element (sorted_, middle);
  return *middle;
}

/* A pixel that is far off costs its bits, however far it is. */
constexpr float kMaxDepthError = 1.5f, kMaxError = 2.5f;

float
MotionSearch::error_of (const MotionScale &scale, const BlockMotion &m) const
{
  float sum = kMaxError * float (samples_.size () - pairs_.size ());
  for (const Pair &p : pairs_) {
    const auto d = float (p.depth - depth_offset (m, scale, p.x, p.y));
    sum += std::min (std::min (d * d * depth_weight_, kMaxDepthError) + p.colour_error, kMaxError);
  }
  return sum;
}

/* Least squares over the pairs that are near the plane of the last round. */
void
MotionSearch::fit_plane (const MotionScale &scale, BlockMotion &m) const
{
  constexpr std::size_t kMinPairs = 8;
  if (pairs_.size () < kMinPairs)
    return;
  float plane[3] = {float (m.dz * scale.unit), 0, 0}; /* codes: at the centre, per column and row */
  for (int round = 0; round < 3; round++) {
    const float near = round == 0 ? 16 / depth_weight_ : 4 / depth_weight_; /* squared */
    float a[3][4] = {};
    std::size_t count = 0;
    for (const Pair &p : pairs_) {
      const float u[] = {1, float (p.x - 7), float (p.y - 7)};
      const auto d = float (p.depth), off = d - plane[0] - plane[1] * u[1] - plane[2] * u[2];
      if (off * off > near)
        continue;
      count++;
      for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
          a[i][j] += u[i] * u[j];
        a[i][3] += u[i] * d;
      }
    }
    if (count < kMinPairs)
      return;
    a[1][1] += 8; /* where the pairs do not tell, there is no slope */
    a[2][2] += 8;
    for (int i = 0; i < 2; i++)
      for (int j = i + 1; j < 3; j++) {
        const float f = a[j][i] / a[i][i];
        for (int k = i; k < 4; k++)
          a[j][k] -= f * a[i][k];
      }
    plane[2] = a[2][3] / a[2][2];
    plane[1] = (a[1][3] - a[1][2] * plane[2]) / a[1][1];
    plane[0] = (a[0][3] - a[0][1] * plane[1] - a[0][2] * plane[2]) / a[0][0];
  }
  const auto units = [&] (float codes) {
    return static_cast<std::int32_t> (std::lround (codes / float (scale.unit)));
  };
  BlockMotion tilted = m;
  tilted.dz =
      std::clamp (units (plane[0]), -kMaxMotionDepth / scale.unit, kMaxMotionDepth / scale.unit);
  tilted.slope_x = std::clamp (units (8 * plane[1]), -kMaxMotionSlope, kMaxMotionSlope);
  tilted.slope_y = std::clamp (units (8 * plane[2]), -kMaxMotionSlope, kMaxMotionSlope);
  constexpr float kPriceOfSlope = 0.5f;
  if (error_of (scale, tilted) + kPriceOfSlope < error_of (scale, m))
    m = tilted;
}

BlockMotion
MotionSearch::find (const Pictures &pictures, Components threshold, const Area &area,
    std::span<const BlockMotion> near_by, MotionMemory &memory)
{
  const auto weight = [] (std::int32_t t) { return 1 / ((float (t) + 0.5f) * (float (t) + 0.5f)); };
  depth_weight_ = weight (threshold[0]);
  /* Squares of R, G and B added up are about 3 Y^2 + Co^2 / 2 + 3 Cg^2 / 4. */
  colour_weights_ = FloatComponents{0, 3, 0.5f, 0.75f} * weight (threshold[1]);
  collect_samples (pictures, area);
  const auto all = float (samples_.size ());
  const float price = all / 64; /* of a motion, in errors: it costs bits */
  const MotionScale &scale = pictures.scale;
  BlockMotion best;
  float least = 0;
  const auto attempt = [&] (int dx, int dy, float cost) {
    BlockMotion m = {dx, dy, 0, 0, 0};
    if (std::abs (dx) > kMaxMotion || std::abs (dy) > kMaxMotion)
      return false;
    pair_up (pictures, area, m);
    if (!pairs_.empty ()) {
      const std::int32_t depth = median_depth ();
      m.dz = std::abs (depth) <= threshold[0] / 6 ? 0 : depth / scale.unit;
    }
    const float error = error_of (scale, m) + cost;
    if (error >= least)
      return false;
    least = error;
    best = m;
    return true;
  };
  least = kMaxError * all + 1;
  attempt (0, 0, -price);
  const BlockMotion &left = near_by[0], last = memory.before (area.x, area.y);
  if (left.dx != 0 || left.dy != 0)
    attempt (left.dx, left.dy, -price);
  for (const BlockMotion &m : {near_by[1], last})
    if (m.dx != best.dx || m.dy != best.dy)
      attempt (m.dx, m.dy, 0);
  for (const int step : {4, 2, 1})
    for (bool better = step < 4 || least > all / 4; better && least > price / 2;) {
      const int x = best.dx, y = best.dy;
      better = attempt (x - step, y, 0) || attempt (x + step, y, 0);
      better |= attempt (best.dx, y - step, 0) || attempt (best.dx, y + step, 0);
    }
  pair_up (pictures, area, best);
  fit_plane (scale, best);
  least = error_of (scale, best);
  pair_up (pictures, area, left);
  if (is_sound (left, scale) && error_of (scale, left) - 2 * price < least)
    best = left;
  /* Partitions may share a block: the one with its first pixel records its motion. */
  const auto begins = [] (int at, int of_roi) { return at % kMotionBlock == 0 || at == of_roi; };
  if (begins (area.x, pictures.image.roi.x) && begins (area.y, pictures.image.roi.y))
    memory.keep (area.x, area.y, best);
  return best;
}

} // namespace rangecast
