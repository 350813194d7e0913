/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "planes.hpp"

#if HAVE_PNG
#include <cstring>
#include <png.h>
#endif

using namespace rangecast;

namespace bench {

#if HAVE_PNG
namespace {

/* libpng leaves by longjmp where something is wrong; nothing with a destructor lives in the
 * functions that it jumps out of. */
class Png final : public PlaneCode {
public:
  Png (PngLevel level, bool colour) : level_ (level), colour_ (colour) {}

  Status encode (const Picture &from, Bytes &to) override
  {
    to.size = 0;
    rows_.clear ();
    for (int y = 0; y < from.height; y++) {
      const std::ptrdiff_t at = std::ptrdiff_t{y} * from.width;
      const void *row = colour_ ? static_cast<const void *> (from.colour.data () + at)
                                : static_cast<const void *> (from.depth.data () + at);
      rows_.push_back (const_cast<png_bytep> (static_cast<png_const_bytep> (row)));
    }
    png_structp png = png_create_write_struct (PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct (png);
    const bool ok = write (png, info, from.width, from.height, to);
    png_destroy_write_struct (&png, &info);
    return ok ? Status{} : Status{StatusCode::kBadData, "libpng cannot write the picture"};
  }

  Status decode (std::span<const std::uint8_t> from, Picture &to) override
  {
    png_structp png = png_create_read_struct (PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct (png);
    const bool ok = read (png, info, from, to);
    png_destroy_read_struct (&png, &info, nullptr);
    return ok ? Status{} : Status{StatusCode::kBadData, "libpng cannot read the picture"};
  }

private:
  bool write (png_structp png, png_infop info, int width, int height, Bytes &to)
  {
    if (setjmp (png_jmpbuf (png)))
      return false;
    const auto append = [] (png_structp p, png_bytep data, std::size_t size) {
      auto *bytes = static_cast<Bytes *> (png_get_io_ptr (p));
      if (bytes->room.size () < bytes->size + size)
        bytes->room.resize (2 * (bytes->size + size));
      std::memcpy (bytes->room.data () + bytes->size, data, size);
      bytes->size += size;
    };
    png_set_write_fn (png, &to, append, nullptr);
    if (level_ == PngLevel::kFast) {
      png_set_compression_level (png, 1);
      png_set_filter (png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    }
    png_set_IHDR (png, info, png_uint_32 (width), png_uint_32 (height), colour_ ? 8 : 16,
        colour_ ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
        PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info (png, info);
    if (colour_)
      png_set_filler (png, 0, PNG_FILLER_AFTER);
    else
      png_set_swap (png);
    png_write_image (png, rows_.data ());
    png_write_end (png, nullptr);
    return true;
  }

  bool read (png_structp png, png_infop info, std::span<const std::uint8_t> &from, Picture &to)
  {
    if (setjmp (png_jmpbuf (png)))
      return false;
    const auto take = [] (png_structp p, png_bytep data, std::size_t size) {
      auto *rest = static_cast<std::span<const std::uint8_t> *> (png_get_io_ptr (p));
      if (rest->size () < size)
        png_error (p, "ends early");
      std::memcpy (data, rest->data (), size);
      *rest = rest->subspan (size);
    };
    png_set_read_fn (png, &from, take);
    png_read_info (png, info);
    if (png_get_image_width (png, info) != png_uint_32 (to.width) ||
        png_get_image_height (png, info) != png_uint_32 (to.height))
      return false;
    if (colour_)
      png_set_filler (png, 0, PNG_FILLER_AFTER);
    else
      png_set_swap (png);
    for (int y = 0; y < to.height; y++) {
      const std::ptrdiff_t at = std::ptrdiff_t{y} * to.width;
      void *row = colour_ ? static_cast<void *> (to.colour.data () + at)
                          : static_cast<void *> (to.depth.data () + at);
      png_read_row (png, static_cast<png_bytep> (row), nullptr);
    }
    return true;
  }

  PngLevel level_;
  bool colour_;
  std::vector<png_bytep> rows_;
};

} // namespace

std::unique_ptr<PlaneCode>
make_png_depth (PngLevel level)
{
  return std::make_unique<Png> (level, false);
}

std::unique_ptr<PlaneCode>
make_png_colour (PngLevel level)
{
  return std::make_unique<Png> (level, true);
}

#else

std::unique_ptr<PlaneCode>
make_png_depth (PngLevel)
{
  return nullptr;
}

std::unique_ptr<PlaneCode>
make_png_colour (PngLevel)
{
  return nullptr;
}

#endif

} // namespace bench
