/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "../geometry/world_points.hpp"

namespace rangecast {

/** Maximum number of cylinders. */
inline constexpr int kMaxClusters = 8;

/** Finds clusters of points: connected components of occupied places of the floor plan (world x, z)
 *  on a coarse grid. Keeps its memory from frame to frame: some 100 KB. */
class Clusters {
public:
  /** Side of a place, metres; larger where the points spread over more than kSide places. A gap of
   *  two empty places, 8 cm at most, separates two clusters. */
  static constexpr float kPlace = 0.04f;
  /** Minimum share of all points; smaller components join the nearest cluster. */
  static constexpr double kMinShare = 0.05;

  /** Finds the clusters.
   *  @param max_clusters  1 .. kMaxClusters; of more the largest are used
   *  @return how many there are, at least 1 */
  int find (const WorldPoints &cloud, int max_clusters);

  /** The cluster of a point, 0 .. find() - 1, the largest first. */
  [[nodiscard]] std::uint32_t cluster_of (float x, float z) const
  {
    return count_ == 1 ? 0 : cluster_[static_cast<std::size_t> (place_of (x, z))];
  }

private:
  static constexpr int kSide = 128; /* places each way */
  static constexpr std::uint8_t kNoCluster = 255;

  void count_points (const WorldPoints &cloud);
  struct Found {
    std::uint32_t points = 0;
    std::uint16_t label = 0;
  };
  int label_places (int max_clusters, std::array<Found, kMaxClusters + 1> &found);
  std::uint32_t fill_cluster (std::uint16_t place, std::uint16_t label);
  void spread ();
  [[nodiscard]] int place_of (float x, float z) const
  {
    const int column = static_cast<int> ((x - x_min_) * places_per_metre_),
              row = static_cast<int> ((z - z_min_) * places_per_metre_);
    return std::clamp (row, 0, kSide - 1) * kSide + std::clamp (column, 0, kSide - 1);
  }

  float x_min_ = 0, z_min_ = 0, places_per_metre_ = 0;
  std::uint32_t counted_ = 0;
  int count_ = 1;
  std::vector<std::uint32_t> points_; /* of each place */
  std::vector<std::uint16_t> labels_; /* of each place */
  std::vector<std::uint8_t> cluster_; /* of each place */
  std::vector<std::uint16_t> queue_;
};

} // namespace rangecast
