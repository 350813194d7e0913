/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "motion.hpp"

#include <algorithm>

namespace rangecast {

void
fetch_displaced (const ReferencePlane &plane, int x, int y, std::span<const BlockMotion> motions,
    std::int32_t last_depth, int first_y, int end_y, std::span<PixelCode> to)
{
  const int end = x + static_cast<int> (to.size ());
  for (const BlockMotion &m : motions) {
    const int next = std::min ((x / kMotionBlock + 1) * kMotionBlock, end);
    const auto part = to.first (static_cast<std::size_t> (next - x));
    to = to.subspan (part.size ());
    if (y + m.dy < first_y || y + m.dy >= end_y)
      std::ranges::fill (part, kNoPixel);
    else
      plane.fetch (x + m.dx, y + m.dy, part);
    if (m.dz != 0)
      for (PixelCode &code : part)
        if (code != kNoPixel) {
          const auto depth = static_cast<std::int32_t> (code & 0xffff) + m.dz;
          code = (code & ~PixelCode{0xffff}) |
                 static_cast<PixelCode> (std::clamp (depth, 0, last_depth));
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
  differences_.reserve (kMotionBlock * kMotionBlock);
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
        samples_.push_back ({own, x, y});
      }
  }
}

/* The best dz of one displacement is the median of the depth differences. */
MotionSearch::Match
MotionSearch::match (
    const Pictures &pictures, Components threshold, const Area &area, int dx, int dy)
{
  Match found = {{dx, dy, 0}, 0};
  if (std::abs (dx) > kMaxMotion || std::abs (dy) > kMaxMotion)
    return found;
  differences_.clear ();
  for (const Sample &s : samples_) {
    const PixelCode code = s.y + dy >= area.first_y && s.y + dy < area.end_y
                               ? pictures.before.at (s.x + dx, s.y + dy)
                               : kNoPixel;
    if (code == kNoPixel)
      continue;
    const Components difference = s.own - to_rgb (components_of (code), pictures.limits);
    const Components beyond = (difference > threshold) | (difference < -threshold);
    if (is_zero (beyond & Components{0, -1, -1, -1})) /* depth does not count here */
      differences_.push_back (difference[0]);
  }
  if (differences_.empty ())
    return found;
  sorted_ = differences_;
  const auto middle = sorted_.begin () + static_cast<std::ptrdiff_t> (sorted_.size () / 2);
  std::ranges::nth_element (sorted_, middle);
  const auto hits = [&] (int dz) {
    return std::ranges::count_if (
        differences_, [&] (int d) { return std::abs (d - dz) <= threshold[0]; });
  };
  const auto still = hits (0), moved = hits (*middle);
  found.hits = static_cast<int> (std::max (still, moved));
  found.motion.dz = moved > still + still / 16 ? *middle : 0;
  return found;
}

BlockMotion
MotionSearch::find (const Pictures &pictures, Components threshold, const Area &area,
    std::span<const BlockMotion> near_by, MotionMemory &memory)
{
  collect_samples (pictures, area);
  Match best = match (pictures, threshold, area, 0, 0);
  const auto all = static_cast<int> (samples_.size ());
  const auto attempt = [&] (int dx, int dy) {
    const Match other = match (pictures, threshold, area, dx, dy);
    if (other.hits <= best.hits + all / 32) /* a motion costs bits */
      return false;
    best = other;
    return true;
  };
  if (best.hits < all - all / 32) {
    for (const BlockMotion &m : near_by)
      attempt (m.dx, m.dy);
    const BlockMotion last = memory.before (area.x, area.y);
    attempt (last.dx, last.dy);
    for (bool better = true; better && best.hits < all - all / 32;) {
      const int x = best.motion.dx, y = best.motion.dy;
      better = attempt (x - 1, y);
      better |= attempt (x + 1, y);
      better |= attempt (x, y - 1);
      better |= attempt (x, y + 1);
    }
  }
  /* Partitions may share a block: the one with its first pixel records its motion. */
  const auto begins = [] (int at, int of_roi) { return at % kMotionBlock == 0 || at == of_roi; };
  if (begins (area.x, pictures.image.roi.x) && begins (area.y, pictures.image.roi.y))
    memory.keep (area.x, area.y, best.motion);
  return best.motion;
}

} // namespace rangecast
