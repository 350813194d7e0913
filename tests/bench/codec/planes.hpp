/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Codes of single pictures, of which peers are made: one for depth and one for colour. */
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "input.hpp"

namespace bench {

/** Bytes of a code, in room that is kept and not cleared from picture to picture. */
struct Bytes {
  std::vector<std::uint8_t> room;
  std::size_t size = 0; ///< of the code, at the beginning of the room

  std::uint8_t *need (std::size_t most)
  {
    if (room.size () < most)
      room.resize (most);
    return room.data ();
  }
  [[nodiscard]] std::span<const std::uint8_t> used () const { return {room.data (), size}; }
};

/** Codes one plane of pictures. */
class PlaneCode {
public:
  virtual ~PlaneCode () = default;
  virtual rangecast::Status encode (const Picture &from, Bytes &to) = 0;
  virtual rangecast::Status decode (std::span<const std::uint8_t> from, Picture &to) = 0;
};

/** RVL, A. D. Wilson's lossless code of depth ("Fast lossless depth image compression", ISS 2017),
 *  written from its description. */
std::unique_ptr<PlaneCode> make_rvl ();
/** RVL's bytes packed once more by zstd at its fastest level; nothing in a build without it. */
std::unique_ptr<PlaneCode> make_rvl_zstd ();
/** libjpeg-turbo, 4:2:0, its accurate DCT: 1 to 3 % slower than the fast one and 0.3 to 1 dB
 *  better.
 *  @param quality  1 to 100 */
std::unique_ptr<PlaneCode> make_jpeg (int quality);
enum class PngLevel {
  kFast,    ///< zlib's level 1 and one filter, the difference to the left pixel
  kDefault, ///< libpng's own choice: zlib's level 6 and the best of all filters for each row
};
/** 16-bit grey, or RGB; nothing in a build without libpng. */
std::unique_ptr<PlaneCode> make_png_depth (PngLevel level);
std::unique_ptr<PlaneCode> make_png_colour (PngLevel level);

} // namespace bench
