/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camera_lines.hpp"

#include <array>

namespace rangecast {
namespace {

/* Share of the picture's height. */
constexpr double kRoof = 0.15;

using Corners = std::array<Vec3, 4>;

/* Of the picture at some distance, world: its outer edges, not the centres of its pixels. */
Corners
picture_corners (const View &view, double z)
{
  const double right = view.width - 0.5, bottom = view.height - 0.5;
  const auto corner = [&] (double u, double v) {
    return view.world_from_view * view.intrinsics.unproject (u, v, z);
  };
  return {corner (-0.5, -0.5), corner (right, -0.5), corner (right, bottom), corner (-0.5, bottom)};
}

class LineWriter {
public:
  LineWriter (const LineColour &colour, std::vector<LineVertex> &lines)
      : colour_ (colour), lines_ (lines)
  {
  }
  void line (Vec3 a, Vec3 b)
  {
    for (Vec3 p : {a, b})
      lines_.push_back (
          {float (p.x), float (p.y), float (p.z), colour_.red, colour_.green, colour_.blue});
  }
  void loop (const Corners &corners)
  {
    for (std::size_t i = 0; i < corners.size (); i++)
      line (corners[i], corners[(i + 1) % corners.size ()]);
  }

private:
  LineColour colour_;
  std::vector<LineVertex> &lines_;
};

} // namespace

LineColour
camera_colour (std::size_t index)
{
  static constexpr LineColour kColours[] = {{255, 96, 80, "red"}, {96, 220, 96, "green"},
      {96, 160, 255, "blue"}, {255, 208, 64, "yellow"}, {224, 112, 255, "violet"},
      {64, 224, 224, "cyan"}, {255, 160, 64, "orange"}, {224, 224, 224, "white"}};
  return kColours[index % std::size (kColours)];
}

void
append_camera_lines (const View &view, const LineColour &colour, std::vector<LineVertex> &lines)
{
  const Vec3 eye = view.world_from_view.translation;
  const Corners near_by = picture_corners (view, view.near_m);
  const Corners far_off = picture_corners (view, view.far_m);
  LineWriter bright (colour, lines);
  bright.loop (near_by);
  for (Vec3 corner : near_by)
    bright.line (eye, corner);
  const Vec3 middle = 0.5 * (near_by[0] + near_by[1]);
  const Vec3 top = middle + kRoof * (near_by[0] - near_by[3]);
  bright.line (near_by[0], top);
  bright.line (top, near_by[1]);

  const auto half = [] (std::uint8_t v) { return static_cast<std::uint8_t> (v / 2); };
  LineWriter dark ({half (colour.red), half (colour.green), half (colour.blue), {}}, lines);
  dark.loop (far_off);
  for (std::size_t i = 0; i < near_by.size (); i++)
    dark.line (near_by[i], far_off[i]);
}

} // namespace rangecast
