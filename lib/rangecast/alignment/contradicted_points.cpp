/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "contradicted_points.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* Views more than 120 degrees apart see no surface well together. */
constexpr float kMinAxes = -0.5f;

bool
has_colours (const SeenView &view)
{
  return view.gains && view.image.colour.same_size (view.image.depth) && !view.image.depth.empty ();
}

std::array<float, 3>
colour_of (const SeenView &view, int x, int y)
{
  const Rgbx c = view.image.colour.at (x, y);
  const auto &gains = *view.gains;
  return {gains[0] * c.r, gains[1] * c.g, gains[2] * c.b};
}

/* Whether a view sees past a place, everywhere around pixel (x, y), what has not that colour. */
bool
sees_other (const SeenView &view, int x, int y, float beyond, const std::array<float, 3> &colour)
{
  const RangeImage &image = view.image;
  if (x < 1 || y < 1 || x >= image.depth.width - 1 || y >= image.depth.height - 1)
    return false;
  for (int v = y - 1; v <= y + 1; v++)
    for (int u = x - 1; u <= x + 1; u++) {
      const std::array<float, 3> other = colour_of (view, u, v);
      float apart = 0;
      for (std::size_t k = 0; k < 3; k++)
        apart = std::max (apart, std::abs (other[k] - colour[k]));
      /* an invalid pixel is not farther than anything */
      if (static_cast<float> (image.depth.at (u, v)) <= beyond ||
          apart < ContradictedPoints::kOtherColour)
        return false;
    }
  return true;
}

} // namespace

/* Whether another view contradicts one pixel. */
bool
ContradictedPoints::is_contradicted (
    const SeenView &own, const SeenView &seen, const PixelTransfer &t, int x, int y)
{
  const std::uint16_t depth = own.image.depth.at (x, y);
  float place[3];
  for (int k = 0; k < 3; k++)
    place[k] = t.origin[k] +
               static_cast<float> (depth) * (t.corner[k] + static_cast<float> (x) * t.right[k] +
                                                static_cast<float> (y) * t.down[k]);
  if (depth == kInvalidDepth || !(place[2] > 0))
    return false;
  const float u = place[0] / place[2] + 0.5f, v = place[1] / place[2] + 0.5f;
  const ImageView<std::uint16_t> &to = seen.image.depth;
  if (!((u >= 0) & (v >= 0) & (u < static_cast<float> (to.width)) &
          (v < static_cast<float> (to.height))))
    return false;
  const int column = static_cast<int> (u), row = static_cast<int> (v);
  const float beyond = (1 + kMargin) * place[2];
  return static_cast<float> (to.at (column, row)) > beyond &&
         sees_other (seen, column, row, beyond, colour_of (own, x, y));
}

/* Of a row every other pixel, and those around one that is contradicted. */
void
ContradictedPoints::check_row (std::span<const SeenView> views, std::size_t which, int y)
{
  const SeenView &own = views[which];
  const int width = own.image.depth.width, height = own.image.depth.height;
  for (const Other &other : others_) {
    const auto contradicts = [&] (int u, int v) {
      return is_contradicted (own, views[other.which], other.transfer, u, v);
    };
    for (int x = 0; x < width; x += 2) {
      if (!contradicts (x, y))
        continue;
      for (int v = std::max (y - 1, 0); v <= std::min (y + 1, height - 1); v++)
        for (int u = std::max (x - 1, 0); u <= std::min (x + 1, width - 1); u++)
          if (contradicts (u, v))
            found_.push_back (static_cast<std::uint32_t> (v * width + u));
    }
  }
}

void
ContradictedPoints::find (std::span<const SeenView> views, std::size_t which)
{
  found_.clear ();
  others_.clear ();
  const SeenView &own = views[which];
  if (!has_colours (own))
    return;
  for (std::size_t i = 0; i < views.size (); i++) {
    const float *a = own.rays.optical_axis, *b = views[i].rays.optical_axis;
    if (i != which && has_colours (views[i]) && a[0] * b[0] + a[1] * b[1] + a[2] * b[2] >= kMinAxes)
      others_.push_back (
          {i, PixelTransfer (own.rays, own.image.roi, views[i].lookup, views[i].image.roi)});
  }
  if (!others_.empty ())
    for (int y = 0; y < own.image.depth.height; y += 2)
      check_row (views, which, y);
}

void
ContradictedPoints::clear (const RangeImage &image) const
{
  for (const std::uint32_t at : found_) {
    const int width = image.depth.width, pixel = static_cast<int> (at);
    image.depth.at (pixel % width, pixel / width) = kInvalidDepth;
  }
}

} // namespace rangecast
