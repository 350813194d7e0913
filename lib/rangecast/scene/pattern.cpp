/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pattern.hpp"

#include <cmath>

namespace rangecast {
namespace {

double
grid_value (std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed)
{
  const auto h = mix64 (static_cast<std::uint64_t> (x * 73856093 ^ y * 19349663 ^ z * 83492791) ^
                        (std::uint64_t (seed) << 32));
  return static_cast<double> (h >> 40) / (1 << 23) - 1;
}

double
one_octave (Vec3 p, std::uint32_t seed)
{
  const double fx = std::floor (p.x), fy = std::floor (p.y), fz = std::floor (p.z);
  const auto x = static_cast<std::int64_t> (fx), y = static_cast<std::int64_t> (fy),
             z = static_cast<std::int64_t> (fz);
  const double u = smooth_step (0, 1, p.x - fx), v = smooth_step (0, 1, p.y - fy),
               w = smooth_step (0, 1, p.z - fz);
  double plane[2];
  for (int k = 0; k < 2; k++) {
    const double a =
        std::lerp (grid_value (x, y, z + k, seed), grid_value (x + 1, y, z + k, seed), u);
    const double b =
        std::lerp (grid_value (x, y + 1, z + k, seed), grid_value (x + 1, y + 1, z + k, seed), u);
    plane[k] = std::lerp (a, b, v);
  }
  return std::lerp (plane[0], plane[1], w);
}

} // namespace

double
smooth_noise (Vec3 point, double wavelength_m, int octaves, std::uint32_t seed)
{
  double sum = 0, height = 1, total = 0;
  for (int i = 0; i < octaves; i++) {
    sum += height * one_octave ((1 / wavelength_m) * point, seed + static_cast<std::uint32_t> (i));
    total += height;
    height *= 0.6;
    wavelength_m /= 2;
  }
  return sum / total;
}

} // namespace rangecast
