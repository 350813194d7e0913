/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Clothing and hair of the built-in figure: sheets and tubes that hang or stand free of the body,
 * so that one surface hides another. */
#include <algorithm>
#include <cmath>
#include <functional>

#include "figure.hpp"
#include "pattern.hpp"

namespace rangecast {

namespace {

/** A point of a surface, u and v from 0 to 1; seen from outside, u runs to the right, v down. */
using Surface = std::function<Vec3 (double u, double v)>;

Mesh
make_sheet (const Surface &surface, int columns, int rows)
{
  Mesh mesh;
  for (int j = 0; j <= rows; j++)
    for (int i = 0; i <= columns; i++) {
      const double u = double (i) / columns, v = double (j) / rows;
      mesh.vertices.push_back (figure_vertex (surface (u, v), u, v));
    }
  const auto index = [&] (int i, int j) {
    return static_cast<std::uint32_t> (j * (columns + 1) + i);
  };
  for (int j = 0; j < rows; j++)
    for (int i = 0; i < columns; i++) {
      mesh.triangles.push_back ({index (i, j), index (i, j + 1), index (i + 1, j)});
      mesh.triangles.push_back ({index (i + 1, j), index (i, j + 1), index (i + 1, j + 1)});
    }
  compute_normals (mesh);
  mesh.double_sided = true;
  return mesh;
}

/** A straight tube with round ends. `up` is any direction across it. */
Mesh
make_tube (Vec3 from, Vec3 to, double radius_from, double radius_to, Vec3 up)
{
  const Vec3 axis = (1 / norm (to - from)) * (to - from), across = cross (axis, up);
  const Vec3 a = (1 / norm (across)) * across, b = cross (axis, a);
  return make_sheet (
      [=] (double u, double v) {
        /* A quarter of the rows for each end. */
        const double begin = std::clamp (1 - 4 * v, 0.0, 1.0),
                     end = std::clamp (4 * v - 3, 0.0, 1.0), t = std::clamp (2 * v - 0.5, 0.0, 1.0);
        const double radius = std::lerp (radius_from, radius_to, t),
                     bend = (begin + end) * M_PI / 2, angle = 2 * M_PI * u;
        const Vec3 centre =
            from + t * (to - from) + (end - begin > 0 ? 1 : -1) * radius * std::sin (bend) * axis;
        return centre + radius * std::cos (bend) * (std::cos (angle) * a + std::sin (angle) * b);
      },
      14, 16);
}

void
append (Mesh &to, const Mesh &from)
{
  const auto first = static_cast<std::uint32_t> (to.vertices.size ());
  to.vertices.insert (to.vertices.end (), from.vertices.begin (), from.vertices.end ());
  for (const auto &t : from.triangles)
    to.triangles.push_back ({first + t[0], first + t[1], first + t[2]});
}

void
set_head (Mesh &mesh, float head)
{
  for (MeshVertex &vertex : mesh.vertices)
    vertex.head = head;
}

/** One colour with noise. @param length  how much longer than wide the noise is drawn, down */
std::shared_ptr<const MipMap>
make_cloth (Vec3 rgb, double contrast, double wavelength, double length, std::uint32_t seed)
{
  constexpr int kSide = 128;
  std::vector<Rgbx> pixels;
  for (int j = 0; j < kSide; j++)
    for (int i = 0; i < kSide; i++) {
      const Vec3 place{double (i) / kSide, j / length / kSide, 0};
      const double light = 1 + contrast * smooth_noise (place, wavelength, 3, seed);
      pixels.push_back (
          {to_byte (rgb.x * light), to_byte (rgb.y * light), to_byte (rgb.z * light), 255});
    }
  return std::make_shared<MipMap> (kSide, kSide, std::move (pixels));
}

/** A point round the body, `out` metres off its cross-section. @param angle  0 = in front */
Vec3
round_body (const Section &s, double angle, double out)
{
  const double sine = std::sin (angle), cosine = std::cos (angle);
  const double depth = cosine > 0 ? s.front : s.back;
  return {(s.side + out) * sine, s.y, s.centre_z + (depth + out) * cosine};
}

/** As wide as head and shoulders, without the neck between them: what hair falls over. */
Section
hanging_section_at (double y)
{
  const Section own = smooth_section_at (std::max (y, -0.2)), head = smooth_section_at (0.1);
  if (y > 0.1)
    return own;
  return {y, std::max (own.side, 0.95 * head.side), std::max (own.front, 0.9 * head.front),
      std::max (own.back, 0.95 * head.back), std::min (own.centre_z, 0.0)};
}

constexpr double kCrown = 0.222;
const Vec3 kBlond{206, 164, 104};

} // namespace

void
add_long_hair (std::uint32_t seed, Figure &figure)
{
  Mesh cap = make_sheet (
      [] (double u, double v) {
        const double angle = (2 * u - 1) * M_PI, side = std::abs (angle);
        const double over_cheek = smooth_step (0.75, 1.05, side);
        const double over_shoulder = smooth_step (1.2, 1.45, side) * smooth_step (2.1, 1.8, side);
        const double low = std::lerp (std::lerp (0.145, -0.15, over_cheek), -0.085, over_shoulder);
        const double y = std::lerp (kCrown + 0.012, low, v);
        const double ear = smooth_step (0.5, 0.1, std::abs (side - 1.68)) *
                           smooth_step (0.05, 0.02, std::abs (y - 0.08));
        const double wave = 0.003 * std::sin (13 * angle + 30 * y) * smooth_step (0.15, 0.05, y);
        Section s = hanging_section_at (std::min (y, kCrown - 0.002));
        s.y = y;
        /* The crown's rim has no width; the sheet closes over it. */
        return round_body (s, angle, (0.016 + wave + 0.012 * ear) * smooth_step (0, 0.08, v));
      },
      96, 48);
  cap.texture = make_cloth (kBlond, 0.55, 0.02, 9, seed + 21);
  figure.push_back (std::move (cap));

  struct Strand {
    double angle, width, out, from_y, to_y, sway;
  };
  constexpr Strand kStrands[] = {{0.62, 0.20, 0.020, 0.15, -0.12, 0.05},
      {0.92, 0.24, 0.030, 0.11, -0.16, -0.06}, {-0.68, 0.22, 0.024, 0.14, -0.15, 0.06},
      {-1.00, 0.20, 0.034, 0.09, -0.12, 0.05}, {0.30, 0.10, 0.014, 0.18, 0.07, 0.08}};
  Mesh strands;
  for (const Strand &k : kStrands)
    append (
        strands, make_sheet (
                     [k] (double u, double v) {
                       const double y = std::lerp (k.from_y, k.to_y, v);
                       const double width = k.width * (1 - 0.5 * v);
                       const double angle = k.angle + (u - 0.5) * width + k.sway * std::sin (3 * v);
                       const double out = k.out * std::sin (M_PI * std::min (1.2 * v, 1.0)) + 0.018;
                       return round_body (hanging_section_at (y), angle, out);
                     },
                     5, 32));
  strands.texture = make_cloth (0.85 * kBlond, 0.5, 0.2, 8, seed + 22);
  strands.double_sided = true;
  figure.push_back (std::move (strands));
}

void
add_glasses (Figure &figure)
{
  constexpr double kRim = 0.0018, kX = 0.032, kY = 0.094, kZ = 0.103;
  Mesh glasses;
  for (const double side : {-1.0, 1.0}) {
    append (glasses, make_sheet (
                         [side] (double u, double v) {
                           const double a = 2 * M_PI * u, b = 2 * M_PI * v;
                           const double x =
                               kX * side + (0.024 + kRim * std::cos (b)) * std::cos (a);
                           return Vec3{x, kY + (0.020 + kRim * std::cos (b)) * std::sin (a),
                               kZ - 3 * x * x + kRim * std::sin (b)};
                         },
                         40, 8));
    const Vec3 hinge{side * 0.057, kY + 0.006, kZ - 3 * 0.057 * 0.057},
        ear{side * 0.088, kY + 0.004, -0.01};
    append (glasses, make_tube (hinge, ear, kRim, kRim, {0, 1, 0}));
  }
  append (glasses, make_tube ({-0.009, kY + 0.004, kZ + 0.004}, {0.009, kY + 0.004, kZ + 0.004},
                       kRim, kRim, {0, 1, 0}));
  set_head (glasses, 1);
  glasses.texture = Mesh::plain_texture ({28, 26, 30, 255});
  glasses.double_sided = true;
  figure.push_back (std::move (glasses));
}

void
add_collar (std::uint32_t seed, Figure &figure)
{
  Mesh collar = make_sheet (
      [] (double u, double v) {
        constexpr double kOpen = 0.32;
        const double angle = kOpen + u * 2 * (M_PI - kOpen), y = -0.022 - 0.058 * v;
        const Vec3 p = round_body (smooth_section_at (y), angle, 0.013 + 0.018 * v);
        return Vec3{p.x, p.y - 0.012 * std::cos (angle), p.z};
      },
      60, 8);
  set_head (collar, 0);
  collar.texture = make_cloth ({226, 226, 230}, 0.04, 0.1, 1, seed + 23);
  figure.push_back (std::move (collar));
}

void
add_hand (std::uint32_t seed, Figure &figure)
{
  const Vec3 elbow{-0.205, -0.235, 0.07}, wrist{-0.045, -0.155, 0.165};
  const Vec3 along = (1 / norm (wrist - elbow)) * (wrist - elbow), up{0, 0, 1};
  Mesh sleeve = make_tube (elbow, wrist, 0.040, 0.029, up);
  set_head (sleeve, 0);
  sleeve.texture = make_cloth ({60, 74, 118}, 0.5, 0.08, 1, seed + 24);
  figure.push_back (std::move (sleeve));

  const Vec3 across = (1 / norm (cross (up, along))) * cross (up, along),
             palm = wrist + 0.065 * along;
  Mesh hand = make_tube (wrist + 0.01 * along, palm, 0.022, 0.030, up);
  for (MeshVertex &v : hand.vertices) /* a palm is flat */
    v.z = static_cast<float> (palm.z + 0.6 * (v.z - palm.z));
  constexpr double kLengths[] = {0.052, 0.066, 0.072, 0.060};
  for (int i = 0; i < 4; i++) {
    const double place = 1.5 - i;
    const Vec3 knuckle = palm - 0.0155 * place * across + 0.012 * along;
    append (hand, make_tube (knuckle, knuckle + kLengths[i] * along - 0.008 * place * across,
                      0.0085, 0.0068, up));
  }
  append (hand,
      make_tube (wrist + 0.03 * along + 0.016 * across, palm + 0.052 * across, 0.012, 0.0085, up));
  compute_normals (hand);
  set_head (hand, 0);
  hand.double_sided = true;
  hand.texture = make_cloth ({214, 166, 142}, 0.12, 0.15, 1, seed + 25);
  figure.push_back (std::move (hand));
}

} // namespace rangecast
