/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surface.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <sstream>
#include <zlib.h>

using namespace rangecast;

namespace bench {

namespace {

constexpr double kCell = 0.01; ///< metres
constexpr double kLargest = 5; ///< metres from the origin; bounds the cells

/* The point of a triangle that is nearest to p, by the region of its plane that p lies over
 * (Ericson, Real-Time Collision Detection, 5.1.5). */
Vec3
nearest_of (Vec3 p, Vec3 a, Vec3 b, Vec3 c)
{
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = dot (ab, ap), d2 = dot (ac, ap);
  if (d1 <= 0 && d2 <= 0)
    return a;
  const Vec3 bp = p - b;
  const double d3 = dot (ab, bp), d4 = dot (ac, bp);
  if (d3 >= 0 && d4 <= d3)
    return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0)
    return a + d1 / (d1 - d3) * ab;
  const Vec3 cp = p - c;
  const double d5 = dot (ab, cp), d6 = dot (ac, cp);
  if (d6 >= 0 && d5 <= d6)
    return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0)
    return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double sum = va + vb + vc;
  return std::abs (sum) > 0 ? a + vb / sum * ab + vc / sum * ac : a;
}

} // namespace

Surface::Surface (std::vector<Vec3> vertices, std::vector<Triangle> triangles)
    : vertices_ (std::move (vertices)), triangles_ (std::move (triangles))
{
  Vec3 high{-1e9, -1e9, -1e9};
  corner_ = {1e9, 1e9, 1e9};
  for (const Vec3 &v : vertices_) {
    corner_ = {std::min (corner_.x, v.x), std::min (corner_.y, v.y), std::min (corner_.z, v.z)};
    high = {std::max (high.x, v.x), std::max (high.y, v.y), std::max (high.z, v.z)};
  }
  const Vec3 size = high - corner_;
  cells_ = {int (size.x / kCell) + 1, int (size.y / kCell) + 1, int (size.z / kCell) + 1};
  begin_.assign (std::size_t (cells_[0]) * cells_[1] * cells_[2] + 1, 0);
  for (const Triangle &t : triangles_)
    for_each_cell (t, [&] (std::size_t cell) { begin_[cell + 1]++; });
  for (std::size_t i = 1; i < begin_.size (); i++)
    begin_[i] += begin_[i - 1];
  members_.resize (begin_.back ());
  std::vector<std::uint32_t> next = begin_;
  for (std::size_t i = 0; i < triangles_.size (); i++)
    for_each_cell (triangles_[i],
        [&] (std::size_t cell) { members_[next[cell]++] = static_cast<std::uint32_t> (i); });
}

std::array<int, 3>
Surface::cell_of (Vec3 p) const
{
  const Vec3 d = p - corner_;
  return {int (std::floor (d.x / kCell)), int (std::floor (d.y / kCell)),
      int (std::floor (d.z / kCell))};
}

/* All cells that the triangle's box touches. */
template <typename Work>
void
Surface::for_each_cell (const Triangle &t, const Work &work) const
{
  std::array<int, 3> low = cell_of (vertices_[t[0]]), high = low;
  for (std::uint32_t v : t)
    for (std::size_t k = 0; k < 3; k++) {
      low[k] = std::min (low[k], cell_of (vertices_[v])[k]);
      high[k] = std::max (high[k], cell_of (vertices_[v])[k]);
    }
  for (int z = low[2]; z <= high[2]; z++)
    for (int y = low[1]; y <= high[1]; y++)
      for (int x = low[0]; x <= high[0]; x++)
        work ((std::size_t (z) * cells_[1] + y) * cells_[0] + x);
}

Vec3
Surface::normal_of (const Triangle &t) const
{
  return cross (vertices_[t[1]] - vertices_[t[0]], vertices_[t[2]] - vertices_[t[0]]);
}

std::optional<double>
Surface::distance (Vec3 p) const
{
  const std::array<int, 3> centre = cell_of (p);
  double least = kFarthest * kFarthest, sign = 0, least_tilt = -1;
  /* What shell k of cells (k = 0: the point's own) holds is at least k - 1 cells away. */
  for (int k = 0; (k - 1) * kCell < std::sqrt (least) && k <= int (kFarthest / kCell) + 1; k++)
    for (int z = std::max (0, centre[2] - k); z <= std::min (cells_[2] - 1, centre[2] + k); z++)
      for (int y = std::max (0, centre[1] - k); y <= std::min (cells_[1] - 1, centre[1] + k); y++) {
        const bool face = std::abs (z - centre[2]) == k || std::abs (y - centre[1]) == k;
        for (int x = centre[0] - k; x <= centre[0] + k; x += face || k == 0 ? 1 : 2 * k) {
          if (x < 0 || x >= cells_[0])
            continue;
          const std::size_t cell = (std::size_t (z) * cells_[1] + y) * cells_[0] + x;
          for (std::uint32_t i = begin_[cell]; i < begin_[cell + 1]; i++) {
            const Triangle &t = triangles_[members_[i]];
            const Vec3 d = p - nearest_of (p, vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]);
            const double square = dot (d, d);
            if (square > least * (1 + 1e-9))
              continue;
            /* At an edge both triangles are as near; the one that faces p says the side. */
            const Vec3 n = normal_of (t);
            const double tilt = std::abs (dot (n, d)) / (norm (n) + 1e-30);
            if (square < least * (1 - 1e-9) || tilt > least_tilt)
              least_tilt = tilt, sign = dot (n, d) < 0 ? -1 : 1;
            least = std::min (least, square);
          }
        }
      }
  if (sign == 0)
    return {};
  return sign * std::sqrt (least);
}

std::vector<Sample>
Surface::samples (int count) const
{
  std::vector<double> areas;
  double area = 0;
  for (const Triangle &t : triangles_)
    areas.push_back (area += norm (normal_of (t)) / 2);
  std::mt19937 random (1);
  std::uniform_real_distribution<double> uniform;
  std::vector<Sample> samples;
  std::size_t at = 0;
  for (int i = 0; i < count; i++) {
    while (at + 1 < areas.size () && areas[at] < area * (i + 0.5) / count)
      at++;
    const Triangle &t = triangles_[at];
    double a = uniform (random), b = uniform (random);
    if (a + b > 1)
      a = 1 - a, b = 1 - b;
    const Vec3 n = normal_of (t), p = vertices_[t[0]];
    samples.push_back (
        {p + a * (vertices_[t[1]] - p) + b * (vertices_[t[2]] - p), 1 / (norm (n) + 1e-30) * n});
  }
  return samples;
}

namespace {

Status
unzip (const std::string &path, std::string &text)
{
  gzFile file = gzopen (path.c_str (), "rb");
  if (!file)
    return {StatusCode::kNotFound, path + ": cannot be read, expected a PLY mesh"};
  char part[65536];
  int got;
  while ((got = gzread (file, part, sizeof part)) > 0)
    text.append (part, std::size_t (got));
  gzclose (file);
  if (got < 0)
    return {StatusCode::kBadData, path + ": ends too early, or is damaged"};
  return {};
}

} // namespace

Status
load_ply (const std::string &path, double scale, std::vector<Vec3> &vertices,
    std::vector<Surface::Triangle> &triangles)
{
  std::string text;
  if (Status s = unzip (path, text); !s.ok ())
    return s;
  const Status bad = {StatusCode::kBadData,
      path + ": expected ASCII PLY, element vertex (x y z ...) and element face (triangles)"};
  std::istringstream in (text);
  std::string line;
  std::size_t points = 0, faces = 0;
  bool ascii = false;
  while (std::getline (in, line) && line != "end_header") {
    ascii |= line == "format ascii 1.0";
    if (line.starts_with ("element vertex "))
      points = std::strtoul (line.c_str () + 15, nullptr, 10);
    if (line.starts_with ("element face "))
      faces = std::strtoul (line.c_str () + 13, nullptr, 10);
  }
  if (!ascii || !points || !faces || points > text.size () || faces > text.size ())
    return bad;
  for (std::size_t i = 0; i < points && std::getline (in, line); i++) {
    Vec3 v;
    if (!(std::istringstream (line) >> v.x >> v.y >> v.z))
      return bad;
    if (!(scale * norm (v) < kLargest))
      return {StatusCode::kBadData, path + ": reaches beyond 5 metres"};
    vertices.push_back (scale * v);
  }
  for (std::size_t i = 0; i < faces; i++) {
    std::size_t n = 0;
    Surface::Triangle t{};
    if (!(in >> n >> t[0] >> t[1] >> t[2]) || n != 3 ||
        std::ranges::any_of (t, [&] (auto v) { return v >= vertices.size (); }))
      return bad;
    triangles.push_back (t);
  }
  return {};
}

} // namespace bench
