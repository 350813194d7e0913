/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "contradicted_points.hpp"

#include <algorithm>
#include <cmath>

#include "../for_this_cpu.hpp"

namespace rangecast {
namespace {

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

void
ContradictedPoints::check_row (std::span<const SeenView> views, std::size_t which, int y)
{
  const RangeImage &image = views[which].image;
  const std::uint16_t *depth = image.depth.row (y);
  const auto width = static_cast<std::size_t> (image.depth.width);
  for (const Other &other : others_) {
    const PixelTransfer &t = other.transfer;
    float ray[3];
    for (int k = 0; k < 3; k++)
      ray[k] = t.corner[k] + static_cast<float> (y) * t.down[k];
    for (std::size_t x = 0; x < width; x++) {
      const auto d = static_cast<float> (depth[x]), column = static_cast<float> (x);
      float place[3];
      for (int k = 0; k < 3; k++)
        place[k] = t.origin[k] + d * (ray[k] + column * t.right[k]);
      z_[x] = place[2];
      u_[x] = place[0] / place[2] + 0.5f;
      v_[x] = place[1] / place[2] + 0.5f;
    }
    const SeenView &seen = views[other.which];
    const RangeImage &to = seen.image;
    const auto right = static_cast<float> (to.depth.width),
               bottom = static_cast<float> (to.depth.height);
    for (std::size_t x = 0; x < width; x++) {
      if (depth[x] == kInvalidDepth ||
          !((z_[x] > 0) & (u_[x] >= 0) & (v_[x] >= 0) & (u_[x] < right) & (v_[x] < bottom)))
        continue;
      const int u = static_cast<int> (u_[x]), v = static_cast<int> (v_[x]);
      const float beyond = (1 + kMargin) * z_[x];
      if (static_cast<float> (to.depth.at (u, v)) > beyond &&
          sees_other (seen, u, v, beyond, colour_of (views[which], static_cast<int> (x), y)))
        found_.push_back (static_cast<std::uint32_t> (static_cast<std::size_t> (y) * width + x));
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
  for (std::size_t i = 0; i < views.size (); i++)
    if (i != which && has_colours (views[i]))
      others_.push_back (
          {i, PixelTransfer (own.rays, own.image.roi, views[i].lookup, views[i].image.roi)});
  const auto width = static_cast<std::size_t> (own.image.depth.width);
  if (others_.empty ())
    return;
  if (z_.size () < width) /* the last to grow: all have grown */
    for (auto *row : {&u_, &v_, &z_})
      row->resize (width);
  for_this_cpu ([&] {
    for (int y = 0; y < own.image.depth.height; y++)
      check_row (views, which, y);
  });
}

std::size_t
ContradictedPoints::clear (const RangeImage &image) const
{
  for (const std::uint32_t at : found_) {
    const int width = image.depth.width, pixel = static_cast<int> (at);
    image.depth.at (pixel % width, pixel / width) = kInvalidDepth;
  }
  return found_.size ();
}

} // namespace rangecast
