/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_tint.hpp"

#include <iterator>

namespace rangecast {

ViewColour
view_colour (std::size_t index)
{
  static constexpr ViewColour kColours[] = {{255, 96, 80, "red"}, {96, 220, 96, "green"},
      {96, 160, 255, "blue"}, {255, 208, 64, "yellow"}, {224, 112, 255, "violet"},
      {64, 224, 224, "cyan"}, {255, 160, 64, "orange"}, {224, 224, 224, "white"}};
  return kColours[index % std::size (kColours)];
}

ImageView<Rgbx>
tinted (const ImageView<const Rgbx> &picture, const ViewColour &colour, std::vector<Rgbx> &memory)
{
  const auto width = static_cast<std::size_t> (picture.width);
  memory.resize (width * static_cast<std::size_t> (picture.height));
  const ImageView<Rgbx> copy{
      memory.data (), picture.width, picture.height, std::ptrdiff_t (width * sizeof (Rgbx))};
  for (int y = 0; y < picture.height; y++) {
    const Rgbx *from = picture.row (y);
    Rgbx *to = copy.row (y);
    for (int x = 0; x < picture.width; x++) {
      /* brightness with the weights of ITU-R BT.601, in 256ths; 255 is the half without it */
      const unsigned share = 255 + ((77u * from[x].r + 150u * from[x].g + 29u * from[x].b) >> 8);
      const auto shade = [share] (
                             unsigned c) { return static_cast<std::uint8_t> (c * share / 510); };
      to[x] = {shade (colour.red), shade (colour.green), shade (colour.blue), 0};
    }
  }
  return copy;
}

} // namespace rangecast
