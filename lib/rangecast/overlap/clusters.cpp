/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clusters.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rangecast {
namespace {

/* Every fourth point is enough to find the clusters. */
constexpr std::size_t kStep = 4;

/* Calls work for a place and the places beside it. */
template <typename Work>
void
for_neighbours (int place, int side, const Work &work)
{
  const int column = place % side, row = place / side;
  for (int r = std::max (row - 1, 0); r <= std::min (row + 1, side - 1); r++)
    for (int c = std::max (column - 1, 0); c <= std::min (column + 1, side - 1); c++)
      work (r * side + c);
}

} // namespace

/* Lays the grid over the points, and counts those of each place. */
void
Clusters::count_points (const WorldPoints &cloud)
{
  constexpr float kHuge = std::numeric_limits<float>::max ();
  float x_max = -kHuge, z_max = -kHuge;
  x_min_ = z_min_ = kHuge;
  for (const WorldPoints::Part &part : cloud.parts ())
    for (std::size_t i = part.begin; i < part.end; i += kStep) {
      x_min_ = std::min (x_min_, cloud.x[i]);
      x_max = std::max (x_max, cloud.x[i]);
      z_min_ = std::min (z_min_, cloud.z[i]);
      z_max = std::max (z_max, cloud.z[i]);
    }
  const float side = std::max ({x_max - x_min_, z_max - z_min_, 0.f});
  places_per_metre_ = 1 / std::max (kPlace, side / (kSide - 1));
  points_.assign (kSide * kSide, 0);
  counted_ = 0;
  for (const WorldPoints::Part &part : cloud.parts ())
    for (std::size_t i = part.begin; i < part.end; i += kStep, counted_++)
      points_[place_of (cloud.x[i], cloud.z[i])]++;
}

/* Labels the component of a place. @return the number of its points */
std::uint32_t
Clusters::fill_cluster (std::uint16_t place, std::uint16_t label)
{
  std::uint32_t points = 0;
  queue_.clear ();
  queue_.push_back (place);
  labels_[place] = label;
  for (std::size_t next = 0; next < queue_.size (); next++) {
    points += points_[queue_[next]];
    for_neighbours (queue_[next], kSide, [&] (int other) {
      if (points_[other] > 0 && labels_[other] == 0) {
        labels_[other] = label;
        queue_.push_back (static_cast<std::uint16_t> (other));
      }
    });
  }
  return points;
}

/* Assigns all other places to the nearest cluster. */
void
Clusters::spread ()
{
  queue_.clear ();
  for (int place = 0; place < kSide * kSide; place++)
    if (cluster_[place] != kNoCluster)
      queue_.push_back (static_cast<std::uint16_t> (place));
  for (std::size_t next = 0; next < queue_.size (); next++)
    for_neighbours (queue_[next], kSide, [&] (int other) {
      if (cluster_[other] == kNoCluster) {
        cluster_[other] = cluster_[queue_[next]];
        queue_.push_back (static_cast<std::uint16_t> (other));
      }
    });
}

/* Labels connected places, and lists the largest. @return how many are listed */
int
Clusters::label_places (int max_clusters, std::array<Found, kMaxClusters + 1> &found)
{
  /* A place with a point or two is noise between clusters, not a bridge. */
  const std::uint32_t noise = 1 + counted_ / 5000;
  for (std::uint32_t &points : points_)
    points = points > noise ? points : 0;
  labels_.assign (kSide * kSide, 0);
  queue_.reserve (kSide * kSide);
  int count = 0;
  std::uint16_t label = 0;
  const auto enough = static_cast<std::uint32_t> (kMinShare * counted_);
  for (int place = 0; place < kSide * kSide; place++) {
    if (points_[place] == 0 || labels_[place] != 0)
      continue;
    const std::uint32_t points = fill_cluster (static_cast<std::uint16_t> (place), ++label);
    if (points <= enough)
      continue;
    found[count] = {points, label};
    count = std::min (count + 1, max_clusters);
    std::sort (found.begin (), found.end (), [] (const Found &a, const Found &b) {
      return a.points != b.points ? a.points > b.points : a.label < b.label;
    });
    found[max_clusters] = {};
  }
  return count;
}

int
Clusters::find (const WorldPoints &cloud, int max_clusters)
{
  count_ = 1;
  if (max_clusters <= 1 || cloud.size () == 0)
    return 1;
  count_points (cloud);
  std::array<Found, kMaxClusters + 1> found{};
  count_ = std::max (1, label_places (max_clusters, found));
  if (count_ == 1)
    return 1;
  cluster_.assign (kSide * kSide, kNoCluster);
  for (int place = 0; place < kSide * kSide; place++)
    for (int cluster = 0; cluster < count_; cluster++)
      if (labels_[place] == found[cluster].label)
        cluster_[place] = static_cast<std::uint8_t> (cluster);
  spread ();
  return count_;
}

} // namespace rangecast
