/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "room.hpp"

#include <algorithm>
#include <cmath>

#include "../base/parallel.hpp"
#include "pattern.hpp"

namespace rangecast {
namespace {

constexpr double kFloor = -1.0, kCeiling = 1.4; ///< metres

/** Distance to wall, floor or ceiling, as a multiple of `direction`. */
double
hit_distance (Vec3 from, Vec3 direction, double radius_m)
{
  const double a = direction.x * direction.x + direction.z * direction.z;
  const double b = from.x * direction.x + from.z * direction.z;
  const double c = from.x * from.x + from.z * from.z - radius_m * radius_m;
  double t = a > 1e-12 ? (-b + std::sqrt (std::max (0.0, b * b - a * c))) / a : 1e12;
  if (direction.y < 0)
    t = std::min (t, (kFloor - from.y) / direction.y);
  else if (direction.y > 0)
    t = std::min (t, (kCeiling - from.y) / direction.y);
  return t;
}

/** Blue-grey plaster with boards, so that it looks like neither skin nor shirt. */
Vec3
room_colour (Vec3 p, double radius_m, const RoomPaint &paint)
{
  const auto &[seed, contrast, warmth] = paint;
  double light = 1;
  if (contrast > 0)
    light += contrast * (0.35 * smooth_noise (p, 0.12, 3, seed + 20) +
                            0.25 * smooth_noise (p, 0.5, 2, seed + 30));
  if (p.y < kFloor + 1e-6)
    return light * Vec3{104, 108, 100};
  if (p.y > kCeiling - 1e-6)
    return light * Vec3{150, 156, 160};
  const double along = std::atan2 (p.x, p.z) * radius_m / 0.31;
  const double board = along - std::floor (along);
  const double tone =
      0.85 +
      0.3 *
          double (
              mix64 (static_cast<std::uint64_t> (std::int64_t (std::floor (along)) + seed)) >> 40) /
          (1 << 24);
  const double gap =
      1 - 0.5 * contrast * (smooth_step (0.05, 0.01, board) + smooth_step (0.95, 0.99, board));
  return light * (contrast * tone + (1 - contrast)) * gap *
         (warmth * Vec3{170, 122, 98} + (1 - warmth) * Vec3{96, 124, 140});
}

} // namespace

void
draw_room (const Intrinsics &camera, const Pose &world_from_camera, double radius_m,
    const RoomPaint &paint, ImageView<Rgbx> colour)
{
  in_parallel (static_cast<std::size_t> (colour.height), 0, [&] (std::size_t row) {
    const int y = static_cast<int> (row);
    for (int x = 0; x < colour.width; x++) {
      Vec3 sum;
      for (const double dy : {-0.25, 0.25})
        for (const double dx : {-0.25, 0.25}) {
          const Vec3 ray = world_from_camera.rotation * camera.unproject (x + dx, y + dy, 1);
          const Vec3 from = world_from_camera.translation;
          const Vec3 point = from + hit_distance (from, ray, radius_m) * ray;
          sum = sum + room_colour (point, radius_m, paint);
        }
      colour.at (x, y) = {to_byte (sum.x / 4), to_byte (sum.y / 4), to_byte (sum.z / 4), 0};
    }
  });
}

std::vector<float>
room_inverse_depth (
    const Intrinsics &camera, const Pose &world_from_camera, double radius_m, int width, int height)
{
  std::vector<float> inverse;
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const Vec3 ray = world_from_camera.rotation * camera.unproject (x, y, 1);
      inverse.push_back (
          static_cast<float> (1 / hit_distance (world_from_camera.translation, ray, radius_m)));
    }
  return inverse;
}

} // namespace rangecast
