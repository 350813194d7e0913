/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace rangecast {

/** Non-owning view of an image: pointer, size and row stride. An empty view (width or height 0) may
 *  have a null pointer. */
template <typename T> struct ImageView {
  T *data = nullptr;
  int width = 0;             ///< pixels
  int height = 0;            ///< pixels
  std::ptrdiff_t stride = 0; ///< bytes from one row to the next

  using Byte = std::conditional_t<std::is_const_v<T>, const unsigned char, unsigned char>;

  [[nodiscard]] T *row (int y) const
  {
    return reinterpret_cast<T *> (reinterpret_cast<Byte *> (data) + y * stride);
  }
  [[nodiscard]] T &at (int x, int y) const { return row (y)[x]; }
  [[nodiscard]] bool empty () const { return width <= 0 || height <= 0; }

  template <typename U> [[nodiscard]] bool same_size (const ImageView<U> &other) const
  {
    return width == other.width && height == other.height;
  }

  /** The part that starts at (x, y); it must lie inside. */
  [[nodiscard]] ImageView crop (int x, int y, int crop_width, int crop_height) const
  {
    return {row (y) + x, crop_width, crop_height, stride};
  }

  operator ImageView<const T> () const { return {data, width, height, stride}; }
};

/** One colour pixel, memory order R G B x; x is padding. */
struct Rgbx {
  std::uint8_t r = 0, g = 0, b = 0, x = 0;
};
static_assert (sizeof (Rgbx) == 4 && alignof (Rgbx) == 1);

} // namespace rangecast
