/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "depth_agreement.hpp"

#include <algorithm>
#include <cmath>

#include "../base/simd.hpp"

namespace rangecast {

namespace {

/* Own weight at which a pixel moves half the way. */
constexpr float kHalfWay = 0.1f;

bool
equal_colours (const ConstRangeImage &image, int ax, int ay, int bx, int by)
{
  if (!image.colour.same_size (image.depth))
    return true;
  const Rgbx a = image.colour.at (ax, ay), b = image.colour.at (bx, by);
  return a.r == b.r && a.g == b.g && a.b == b.b;
}

/* Pixels of one row of a view in another view: loops that compilers vectorize. */
struct RowInOther {
  const PixelTransfer &transfer;
  float ray[3]; /* of the row's first pixel, in the other's plane */
  float *u, *v, *z;
  float *const *plane;

  void find (const float *depth, int begin, int end) const
  {
    for (int x = begin; x < end; x++) {
      const auto column = static_cast<float> (x);
      float place[3];
      for (int k = 0; k < 3; k++)
        place[k] = transfer.origin[k] + depth[x] * (ray[k] + column * transfer.right[k]);
      z[x] = place[2];
      u[x] = place[0] / place[2];
      v[x] = place[1] / place[2];
    }
  }

  /* The planes at those places; weight 0 where there is none. */
  void gather (const SurfacePlanes &planes, int begin, int end) const
  {
    const auto right = static_cast<float> (planes.width ()) - 0.5f,
               bottom = static_cast<float> (planes.height ()) - 0.5f;
    for (int x = begin; x < end; x++) {
      SurfacePlane found{1, 0, 0, 0};
      if ((z[x] > 0) & (u[x] > -0.5f) & (v[x] > -0.5f) & (u[x] < right) & (v[x] < bottom)) {
        const int column = static_cast<int> (u[x] + 0.5f), row = static_cast<int> (v[x] + 0.5f);
        found = planes.at (column, row);
        u[x] = static_cast<float> (column);
        v[x] = static_cast<float> (row);
      }
      plane[0][x] = found.depth;
      plane[1][x] = found.across;
      plane[2][x] = found.down;
      plane[3][x] = found.weight;
    }
  }

  /* Adds the intersections of the rays with the planes.
   *  @param closeness  weights are multiplied by (closeness * depth / depth of the other)^4
   *  @param range  how far that may be from depth, as a share of it */
  void meet (const float *depth, int begin, int end, float closeness, float range, float *sum,
      float *weight) const
  {
    for (int x = begin; x < end; x++) {
      const auto column = static_cast<float> (x);
      float r[3];
      for (int k = 0; k < 3; k++)
        r[k] = ray[k] + column * transfer.right[k];
      const float d = plane[0][x], a = plane[1][x], b = plane[2][x], c = d - a * u[x] - b * v[x];
      const float above = d * d - (a * transfer.origin[0] + b * transfer.origin[1] +
                                      c * transfer.origin[2]),
                  along = a * r[0] + b * r[1] + c * r[2];
      const float change = above / along - depth[x], off = change / (range * depth[x]),
                  near = closeness * depth[x] / z[x], near2 = near * near;
      const float rest = 1 - off * off, share = plane[3][x] * near2 * near2 * rest * rest;
      const bool good = (above > 0) & (along > 0) & (rest > 0) & (plane[3][x] > 0);
      sum[x] += good ? share * change : 0.f;
      weight[x] += good ? share : 0.f;
    }
  }
};

} // namespace

void
DepthAgreement::find_others (std::span<const FusedView> views, std::size_t which)
{
  const FusedView &own = views[which];
  others_.clear ();
  for (std::size_t i = 0; i < views.size (); i++) {
    const FusedView &other = views[i];
    if (i == which || other.planes->width () == 0 || !may_share_surfaces (own.rays, other.rays))
      continue;
    others_.push_back (
        {other.planes, PixelTransfer (own.rays, own.image.roi, other.lookup, other.image.roi),
            own.unit_m / other.unit_m * std::sqrt (other.focal_px / own.focal_px)});
  }
}

/* Adds up the changes of depth that the other views suggest for a row. @return false if none */
bool
DepthAgreement::sum_row (const FusedView &own, int y)
{
  const SurfacePlane *planes = own.planes->row (y);
  begin_ = 0, end_ = own.planes->width ();
  while (begin_ < end_ && planes[begin_].weight <= 0)
    begin_++;
  while (end_ > begin_ && planes[end_ - 1].weight <= 0)
    end_--;
  if (begin_ == end_)
    return false;
  const std::uint16_t *depth = own.image.depth.row (y);
  for (int x = begin_; x < end_; x++) {
    depth_[static_cast<std::size_t> (x)] = depth[x];
    sum_[static_cast<std::size_t> (x)] = weight_[static_cast<std::size_t> (x)] = 0;
  }
  float *const plane[] = {
      plane_[0].data (), plane_[1].data (), plane_[2].data (), plane_[3].data ()};
  for (const Other &other : others_) {
    RowInOther row{other.transfer, {}, u_.data (), v_.data (), z_.data (), plane};
    for (int k = 0; k < 3; k++)
      row.ray[k] = other.transfer.corner[k] + static_cast<float> (y) * other.transfer.down[k];
    row.find (depth_.data (), begin_, end_);
    row.gather (*other.planes, begin_, end_);
    row.meet (depth_.data (), begin_, end_, other.closeness, kSurfaceFootprints / own.focal_px,
        sum_.data (), weight_.data ());
  }
  return true;
}

void
DepthAgreement::move_row (const FusedView &own, int y)
{
  const ConstRangeImage image = own.image;
  std::uint16_t *row = own.image.depth.row (y);
  const SurfacePlane *planes = own.planes->row (y);
  for (int x = begin_; x < end_; x++) {
    const auto at = static_cast<std::size_t> (x);
    const std::uint16_t old = present_[at];
    if (!(weight_[at] > 0) || old == kInvalidDepth || planes[x].weight <= 0)
      continue;
    if (x > 0 && present_[at - 1] == old && equal_colours (image, x - 1, y, x, y)) {
      row[x] = row[x - 1];
    } else if (y > 0 && above_[at] == old && equal_colours (image, x, y - 1, x, y)) {
      row[x] = image.depth.at (x, y - 1);
    } else {
      const float own_weight = planes[x].weight, change = own_weight / (own_weight + kHalfWay) *
                                                          sum_[at] / (own_weight + weight_[at]);
      row[x] = static_cast<std::uint16_t> (
          std::clamp (static_cast<float> (old) + change + 0.5f, 1.f, 65535.f));
    }
  }
}

void
DepthAgreement::process (std::span<const FusedView> views, std::size_t which)
{
  const FusedView &own = views[which];
  find_others (views, which);
  if (others_.empty () || own.planes->width () == 0)
    return;
  const auto width = static_cast<std::size_t> (own.planes->width ());
  if (present_.size () < width) { /* the last to grow: all have grown */
    for (auto *row :
        {&depth_, &sum_, &weight_, &u_, &v_, &z_, &plane_[0], &plane_[1], &plane_[2], &plane_[3]})
      row->resize (width);
    above_.resize (width);
    present_.resize (width);
  }
  for_this_cpu ([&] {
    for (int y = 0; y < own.planes->height (); y++) {
      std::swap (above_, present_);
      std::copy_n (own.image.depth.row (y), width, present_.begin ());
      if (sum_row (own, y))
        move_row (own, y);
    }
  });
}

} // namespace rangecast
