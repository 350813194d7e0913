/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The built-in figure is one closed surface over (s, y): s runs once round the body (from the back
 * over the figure's right to the back again, denser in the face), y from the crown to the chest.
 * A table gives the cross-sections, small bumps the features. */
#include <algorithm>
#include <cmath>

#include "../base/parallel.hpp"
#include "figure.hpp"
#include "pattern.hpp"
#include "scene.hpp"

namespace rangecast {

namespace {

constexpr int kColumns = 96;
constexpr int kRows = 68;
constexpr int kTextureSize = 512;
constexpr double kTop = 0.220, kBottom = -0.250; ///< metres

constexpr Section kSections[] = {
    {0.2200, 0.0000, 0.0000, 0.0000, -0.005},
    {0.2150, 0.0300, 0.0380, 0.0400, -0.005},
    {0.2000, 0.0540, 0.0680, 0.0700, -0.003},
    {0.1700, 0.0720, 0.0900, 0.0930, 0.000},
    {0.1300, 0.0780, 0.0960, 0.1000, 0.000},
    {0.1000, 0.0770, 0.0930, 0.0990, 0.000},
    {0.0700, 0.0740, 0.0910, 0.0930, 0.000},
    {0.0400, 0.0680, 0.0890, 0.0830, 0.000},
    {0.0100, 0.0590, 0.0850, 0.0750, 0.000},
    {-0.0100, 0.0500, 0.0760, 0.0700, 0.000},
    {-0.0250, 0.0510, 0.0480, 0.0680, -0.003},
    {-0.0400, 0.0530, 0.0400, 0.0650, -0.008},
    {-0.0650, 0.0600, 0.0420, 0.0640, -0.012},
    {-0.0850, 0.0920, 0.0540, 0.0700, -0.012},
    {-0.1050, 0.1450, 0.0680, 0.0800, -0.012},
    {-0.1300, 0.1950, 0.0820, 0.0900, -0.012},
    {-0.1650, 0.2280, 0.0970, 0.0980, -0.012},
    {-0.2100, 0.2440, 0.1070, 0.1030, -0.012},
    {-0.2500, 0.2480, 0.1120, 0.1050, -0.012},
};

Section
section_at (double y)
{
  std::size_t i = 0;
  while (i + 2 < std::size (kSections) && kSections[i + 1].y > y)
    i++;
  const Section &a = kSections[i], &b = kSections[i + 1];
  const double t = std::clamp ((a.y - y) / (a.y - b.y), 0.0, 1.0);
  /* The crown is round: its radii grow with the root of the way down. */
  const double k = i == 0 ? std::sqrt (t) : t;
  return {y, std::lerp (a.side, b.side, k), std::lerp (a.front, b.front, k),
      std::lerp (a.back, b.back, k), std::lerp (a.centre_z, b.centre_z, t)};
}

} // namespace

Section
smooth_section_at (double y)
{
  constexpr double kSpread = 0.008;
  if (y > kTop - 2 * kSpread)
    return section_at (y);
  Section sum{y, 0, 0, 0, 0};
  const double weights[] = {0.25, 0.5, 0.25};
  for (int i = -1; i <= 1; i++) {
    const Section s = section_at (std::clamp (y + i * kSpread, kBottom, kTop));
    const double w = weights[i + 1];
    sum.side += w * s.side;
    sum.front += w * s.front;
    sum.back += w * s.back;
    sum.centre_z += w * s.centre_z;
  }
  return sum;
}

MeshVertex
figure_vertex (Vec3 p, double u, double v)
{
  MeshVertex vertex{};
  vertex.x = static_cast<float> (p.x);
  vertex.y = static_cast<float> (p.y);
  vertex.z = static_cast<float> (p.z);
  vertex.u = static_cast<float> (u);
  vertex.v = static_cast<float> (v);
  vertex.head = static_cast<float> (smooth_step (-0.09, -0.01, p.y));
  return vertex;
}

namespace {

double
bump (double x, double y, double x0, double y0, double spread_x, double spread_y)
{
  const double dx = (x - x0) / spread_x, dy = (y - y0) / spread_y;
  return std::exp (-0.5 * (dx * dx + dy * dy));
}

/** 1 where hair grows: above a line that is high over the face and low at the back. */
double
hair_at (double angle, double y)
{
  const double face = smooth_step (1.9, 1.0, std::abs (angle));
  const double line = std::lerp (-0.015, 0.158, face);
  return smooth_step (line - 0.004, line + 0.006, y);
}

/** How far features stand out of the cross-section, metres. x: along the section from the middle
 *  of the face. */
double
relief (double angle, double x, double y)
{
  const double side = std::abs (x), nose = smooth_step (0.112, 0.058, y);
  double r = 0;
  r += (0.003 + 0.021 * nose) * smooth_step (0.042, 0.054, y) * smooth_step (0.118, 0.100, y) *
       bump (x, 0, 0, 0, 0.007 + 0.004 * nose, 1);
  r += 0.006 * bump (side, y, 0.013, 0.053, 0.005, 0.006); // nostrils
  r -= 0.010 * bump (side, y, 0.031, 0.095, 0.014, 0.010); // sockets
  r += 0.006 * bump (side, y, 0.031, 0.094, 0.009, 0.007); // eyeballs
  r += 0.005 * bump (side, y, 0.026, 0.116, 0.022, 0.006); // brow ridge
  r += 0.005 * bump (side, y, 0.045, 0.065, 0.016, 0.014); // cheekbones
  r += 0.006 * bump (x, y, 0, 0.026, 0.018, 0.004);        // upper lip
  r += 0.006 * bump (x, y, 0, 0.014, 0.015, 0.004);        // lower lip
  r += 0.007 * bump (x, y, 0, -0.006, 0.016, 0.009);       // chin
  const double ear = std::abs (angle) - 1.68;
  r +=
      0.020 * bump (ear, y, 0, 0.080, 0.10, 0.020) - 0.008 * bump (ear, y, -0.03, 0.08, 0.06, 0.01);
  r += 0.009 * hair_at (angle, y);
  return r;
}

double
angle_of (double s) // s, angle: -pi to pi, 0 in the middle of the face
{
  return s - 0.45 * std::sin (s);
}

Vec3
surface (double s, double y, std::uint32_t seed)
{
  const double angle = angle_of (s);
  const Section c = smooth_section_at (y);
  const double depth = std::cos (angle) > 0 ? c.front : c.back;
  const Vec3 base{c.side * std::sin (angle), y, c.centre_z + depth * std::cos (angle)};
  const double fade = smooth_step (kTop, kTop - 0.012, y);
  double out = relief (angle, 0.09 * angle, y);
  out += 0.004 * hair_at (angle, y) * smooth_noise (base, 0.03, 2, seed);
  out += 0.006 * smooth_step (-0.09, -0.13, y) * smooth_noise (base, 0.07, 2, seed + 9);
  return base + out * fade * Vec3{std::sin (angle), 0, std::cos (angle)};
}

/* Colours are R, G, B, 0 to 255. */
Vec3
mixed (Vec3 a, Vec3 b, double t)
{
  return {std::lerp (a.x, b.x, t), std::lerp (a.y, b.y, t), std::lerp (a.z, b.z, t)};
}

Vec3
face_colour (double x, double y, Vec3 skin)
{
  const double side = std::abs (x);
  const auto ellipse = [&] (double x0, double y0, double rx, double ry) {
    const double d = std::hypot ((side - x0) / rx, (y - y0) / ry);
    return smooth_step (1.12, 0.88, d);
  };
  Vec3 c = mixed (skin, {205, 110, 100}, 0.45 * bump (side, y, 0.043, 0.058, 0.016, 0.014));
  c = mixed (c, {176, 74, 76}, ellipse (0, 0.020, 0.026, 0.010));
  c = mixed (c, {84, 26, 30}, ellipse (0, 0.020, 0.027, 0.0016));
  c = mixed (c, {70, 38, 34}, ellipse (0.008, 0.047, 0.0045, 0.0025));
  c = mixed (c, {60, 38, 26},
      ellipse (0.031, 0.117 - 0.25 * (side - 0.031) * (side - 0.031) / 0.02, 0.020, 0.0042));
  c = mixed (c, {92, 58, 50}, ellipse (0.031, 0.096, 0.0165, 0.0085));
  c = mixed (c, {238, 236, 230}, ellipse (0.031, 0.0945, 0.0145, 0.0062));
  c = mixed (c, {52, 98, 128}, ellipse (0.031, 0.0950, 0.0062, 0.0062));
  return mixed (c, {12, 12, 14}, ellipse (0.031, 0.0950, 0.0028, 0.0028));
}

Vec3
colour_at (double s, double y, std::uint32_t seed)
{
  const double angle = angle_of (s);
  const Section c = section_at (y);
  const Vec3 p{c.side * std::sin (angle), y, c.front * std::cos (angle)};
  const double grain = smooth_noise (p, 0.016, 3, seed + 1);
  Vec3 skin = (1 + 0.17 * grain + 0.08 * smooth_noise (p, 0.05, 1, seed + 5)) * Vec3{214, 166, 142};
  if (std::abs (angle) < 1.2)
    skin = face_colour (0.09 * angle, y, skin);
  const Vec3 strand{p.x, 0.25 * p.y, p.z}; // hair hangs: its noise is drawn out downwards
  const Vec3 hair = (1 + 0.75 * smooth_noise (strand, 0.010, 3, seed + 2)) * Vec3{82, 56, 38};
  /* Blotches, not checks: a pattern that repeats would fool stereo matching. */
  const double blotch = smooth_noise (p, 0.045, 2, seed + 4);
  Vec3 shirt = mixed ({44, 72, 128}, {176, 60, 56}, smooth_step (0.05, 0.2, blotch));
  shirt = (1 + 0.5 * smooth_noise (p, 0.018, 3, seed + 3)) * shirt;
  const double collar = -0.078 - 0.045 * bump (angle, 0, 0, 0, 0.5, 1);
  const Vec3 out = mixed (skin, hair, hair_at (angle, y));
  return mixed (out, shirt, smooth_step (collar + 0.002, collar - 0.002, y));
}

MipMap
make_texture (std::uint32_t seed)
{
  std::vector<Rgbx> pixels (static_cast<std::size_t> (kTextureSize) * kTextureSize);
  in_parallel (kTextureSize, 0, [&] (std::size_t j) {
    for (int i = 0; i < kTextureSize; i++) {
      const double s = ((i + 0.5) / kTextureSize * 2 - 1) * M_PI,
                   y = kTop + (kBottom - kTop) * ((double (j) + 0.5) / kTextureSize);
      const Vec3 c = colour_at (s, y, seed);
      pixels[j * kTextureSize + std::size_t (i)] = {to_byte (c.x), to_byte (c.y), to_byte (c.z), 0};
    }
  });
  return {kTextureSize, kTextureSize, std::move (pixels)};
}

/* Head and shoulders, closed at the bottom. */
Mesh
make_body (std::uint32_t seed)
{
  Mesh mesh;
  for (int j = 0; j <= kRows; j++)
    for (int i = 0; i <= kColumns; i++) {
      const double u = double (i) / kColumns, v = double (j) / kRows;
      /* The seam's two ends are one point; so is the crown. */
      const double s = (double (i % kColumns) / kColumns * 2 - 1) * M_PI;
      mesh.vertices.push_back (
          figure_vertex (surface (j ? s : 0, kTop + (kBottom - kTop) * v, seed), u, v));
    }
  const auto index = [] (int i, int j) {
    return static_cast<std::uint32_t> (j * (kColumns + 1) + i);
  };
  for (int j = 0; j < kRows; j++)
    for (int i = 0; i < kColumns; i++) {
      if (j > 0)
        mesh.triangles.push_back ({index (i, j), index (i, j + 1), index (i + 1, j)});
      mesh.triangles.push_back ({index (i + 1, j), index (i, j + 1), index (i + 1, j + 1)});
    }
  const auto rim = static_cast<std::uint32_t> (kRows * (kColumns + 1));
  const auto centre = static_cast<std::uint32_t> (mesh.vertices.size ());
  mesh.vertices.push_back (figure_vertex ({0, kBottom, -0.01}, 0.5, 1));
  for (std::uint32_t i = 0; i < kColumns; i++)
    mesh.triangles.push_back ({rim + i, centre, rim + i + 1});
  compute_normals (mesh);
  mesh.texture = std::make_shared<MipMap> (make_texture (seed));
  return mesh;
}

} // namespace

Figure
make_figure (std::uint32_t seed, unsigned dress)
{
  Figure figure{make_body (seed)};
  if (dress & kDressHair)
    add_long_hair (seed, figure);
  if (dress & kDressGlasses)
    add_glasses (figure);
  if (dress & kDressCollar)
    add_collar (seed, figure);
  if (dress & kDressHand)
    add_hand (seed, figure);
  return figure;
}

} // namespace rangecast
