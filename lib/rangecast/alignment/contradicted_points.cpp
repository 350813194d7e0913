/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "contradicted_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rangecast {
namespace {

/* Two surfaces differ by no less in R, G or B, grey levels, in all of 3 x 3 pixels: no edge, where
 * two views mix colours differently, is that wide. */
constexpr float kMinPatchDifference = 40;

bool
has_colours (const BalancedView &view)
{
  return view.gains && view.image.colour.same_size (view.image.depth) && !view.image.depth.empty ();
}

/* A colour after colour balance, clipped alike: pixels that are white in both images stay equal. */
std::array<float, 3>
balanced_colour (const BalancedView &view, int x, int y)
{
  const Rgbx c = view.image.colour.at (x, y);
  const auto &gains = *view.gains;
  return {std::min (gains[0] * static_cast<float> (c.r), 255.f),
      std::min (gains[1] * static_cast<float> (c.g), 255.f),
      std::min (gains[2] * static_cast<float> (c.b), 255.f)};
}

/* Whether a view sees, in all of 3 x 3 pixels around (x, y), a farther surface of another colour.
 * An invalid pixel is not farther than anything. */
bool
sees_other (
    const BalancedView &view, int x, int y, float beyond, const std::array<float, 3> &colour)
{
  const RangeImage &image = view.image;
  if (x < 1 || y < 1 || x >= image.depth.width - 1 || y >= image.depth.height - 1)
    return false;
  for (int v = y - 1; v <= y + 1; v++)
    for (int u = x - 1; u <= x + 1; u++) {
      const std::array<float, 3> other = balanced_colour (view, u, v);
      float difference = 0;
      for (std::size_t k = 0; k < 3; k++)
        difference = std::max (difference, std::abs (other[k] - colour[k]));
      if (static_cast<float> (image.depth.at (u, v)) <= beyond || difference < kMinPatchDifference)
        return false;
    }
  return true;
}

bool
is_contradicted (
    const BalancedView &own, const BalancedView &other, const PixelTransfer &transfer, int x, int y)
{
  const std::uint16_t depth = own.image.depth.at (x, y);
  float place[3];
  transfer.find (x, y, depth, place);
  if (depth == kInvalidDepth || !(place[2] > 0))
    return false;
  const float u = place[0] / place[2] + 0.5f, v = place[1] / place[2] + 0.5f;
  const ImageView<std::uint16_t> &to = other.image.depth;
  if (!((u >= 0) & (v >= 0) & (u < static_cast<float> (to.width)) &
          (v < static_cast<float> (to.height))))
    return false;
  const int column = static_cast<int> (u), row = static_cast<int> (v);
  const float beyond = (1 + ContradictedPoints::kMargin) * place[2];
  return static_cast<float> (to.at (column, row)) > beyond &&
         sees_other (other, column, row, beyond, balanced_colour (own, x, y));
}

} // namespace

/* Every other pixel of a row, and those around one that is contradicted. */
void
ContradictedPoints::check_row (std::span<const BalancedView> views, std::size_t which, int y)
{
  const BalancedView &own = views[which];
  const int width = own.image.depth.width, height = own.image.depth.height;
  const auto check = [&] (const Other &other, int u, int v) {
    std::uint8_t &found = found_[static_cast<std::size_t> (v) * static_cast<std::size_t> (width) +
                                 static_cast<std::size_t> (u)];
    if (!found && is_contradicted (own, views[other.which], other.transfer, u, v))
      found = 1, any_ = true;
    return found != 0;
  };
  for (const Other &other : others_)
    for (int x = 0; x < width; x += 2)
      if (check (other, x, y))
        for (int v = std::max (y - 1, 0); v <= std::min (y + 1, height - 1); v++)
          for (int u = std::max (x - 1, 0); u <= std::min (x + 1, width - 1); u++)
            check (other, u, v);
}

void
ContradictedPoints::find (std::span<const BalancedView> views, std::size_t which)
{
  any_ = false;
  others_.clear ();
  const BalancedView &own = views[which];
  if (!has_colours (own))
    return;
  for (std::size_t i = 0; i < views.size (); i++)
    if (i != which && has_colours (views[i]) && may_share_surfaces (own.rays, views[i].rays))
      others_.push_back (
          {i, PixelTransfer (own.rays, own.image.roi, views[i].lookup, views[i].image.roi)});
  const auto pixels = static_cast<std::size_t> (own.image.depth.width) *
                      static_cast<std::size_t> (own.image.depth.height);
  if (found_.size () < pixels)
    found_.resize (pixels);
  std::fill_n (found_.begin (), pixels, std::uint8_t{0});
  if (!others_.empty ())
    for (int y = 0; y < own.image.depth.height; y += 2)
      check_row (views, which, y);
}

std::size_t
ContradictedPoints::clear (const RangeImage &image)
{
  if (!any_)
    return 0;
  std::size_t cleared = 0;
  const auto width = static_cast<std::size_t> (image.depth.width);
  for (int y = 0; y < image.depth.height; y++)
    for (int x = 0; x < image.depth.width; x++)
      if (found_[static_cast<std::size_t> (y) * width + static_cast<std::size_t> (x)]) {
        image.depth.at (x, y) = kInvalidDepth;
        cleared++;
      }
  return cleared;
}

} // namespace rangecast
