/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The true surface. */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <rangecast/base/status.hpp>
#include <rangecast/geometry/camera.hpp>
#include <string>
#include <vector>

namespace bench {

/** A place on the true surface. */
struct Sample {
  rangecast::Vec3 point, normal; ///< metres; unit vector, outward
};

/** A triangle mesh that can be asked how far away it is. */
class Surface {
public:
  using Triangle = std::array<std::uint32_t, 3>;

  /** @param triangles  counter-clockwise seen from outside */
  Surface (std::vector<rangecast::Vec3> vertices, std::vector<Triangle> triangles);

  /** Distance to the nearest point of the mesh, metres, negative inside; nothing if that is
   *  kFarthest or more away. */
  [[nodiscard]] std::optional<double> distance (rangecast::Vec3 point) const;
  static constexpr double kFarthest = 0.06;

  /** That many places, spread evenly over the area; the same ones every time. */
  [[nodiscard]] std::vector<Sample> samples (int count) const;

  [[nodiscard]] const std::vector<rangecast::Vec3> &vertices () const { return vertices_; }

private:
  [[nodiscard]] std::array<int, 3> cell_of (rangecast::Vec3 point) const;
  template <typename Work> void for_each_cell (const Triangle &triangle, const Work &work) const;
  [[nodiscard]] rangecast::Vec3 normal_of (const Triangle &triangle) const;

  std::vector<rangecast::Vec3> vertices_;
  std::vector<Triangle> triangles_;
  rangecast::Vec3 corner_;           /* of the cells */
  std::array<int, 3> cells_{};       /* a side */
  std::vector<std::uint32_t> begin_; /* of each cell in members_ */
  std::vector<std::uint32_t> members_;
};

/** Vertices and triangles of an ASCII PLY, gzipped or not.
 *  @param scale  its units, metres */
rangecast::Status load_ply (const std::string &path, double scale,
    std::vector<rangecast::Vec3> &vertices, std::vector<Surface::Triangle> &triangles);

} // namespace bench
