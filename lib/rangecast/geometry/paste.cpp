/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "paste.hpp"

#include <algorithm>
#include <array>

namespace rangecast {
namespace {

/* Calls copy_row (y, begin, end, to) for each row of the ROI with the columns that lie in the full
 * picture, and clears everything else. */
template <typename T, typename CopyRow>
void
paste (const Roi &roi, ImageView<T> full, CopyRow copy_row)
{
  const int left = std::clamp (roi.x, 0, full.width);
  const int right = std::clamp (roi.x + roi.width, left, full.width);
  for (int y = 0; y < full.height; y++) {
    T *row = full.row (y);
    if (roi.empty () || y < roi.y || y >= roi.y + roi.height) {
      std::fill_n (row, full.width, T{});
      continue;
    }
    std::fill (row, row + left, T{});
    copy_row (y - roi.y, left - roi.x, right - roi.x, row + left);
    std::fill (row + right, row + full.width, T{});
  }
}

/* 1 to 255 from far to near, 0 for invalid depth. */
class DepthLevels {
public:
  DepthLevels (std::uint16_t near, std::uint16_t far) : near_ (near), far_ (far) {}

  int operator() (std::uint16_t depth) const
  {
    if (depth == kInvalidDepth)
      return 0;
    const int range = std::max (far_ - near_, 1);
    return 1 + (254 * (far_ - std::clamp (int (depth), near_, far_)) + range / 2) / range;
  }

private:
  int near_, far_;
};

constexpr std::array<Rgbx, 256>
make_turbo ()
{
  constexpr double kRed[] = {
      0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943};
  constexpr double kGreen[] = {
      0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604};
  constexpr double kBlue[] = {
      0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973};
  const auto level = [] (const double (&polynomial)[6], double x) {
    double sum = 0;
    for (int i = 5; i >= 0; i--)
      sum = sum * x + polynomial[i];
    return static_cast<std::uint8_t> (255 * std::clamp (sum, 0.0, 1.0) + 0.5);
  };
  std::array<Rgbx, 256> palette{};
  palette[0] = {0, 0, 0, 255};
  for (int i = 1; i < 256; i++) {
    const double x = (i - 1) / 254.0;
    palette[std::size_t (i)] = {level (kRed, x), level (kGreen, x), level (kBlue, x), 255};
  }
  return palette;
}

} // namespace

void
paste_depth (const ConstRangeImage &image, ImageView<std::uint16_t> full)
{
  paste (image.roi, full, [&] (int y, int begin, int end, std::uint16_t *to) {
    const std::uint16_t *from = image.depth.row (y);
    std::copy (from + begin, from + end, to);
  });
}

void
paste_colour (const ConstRangeImage &image, bool only_valid, ImageView<Rgbx> full)
{
  paste (image.roi, full, [&] (int y, int begin, int end, Rgbx *to) {
    const Rgbx *from = image.colour.row (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = begin; x < end; x++) {
      *to = only_valid && depth[x] == kInvalidDepth ? Rgbx{} : from[x];
      (to++)->x = 255; /* opaque for those who take x for alpha */
    }
  });
}

void
paste_depth_map (const ConstRangeImage &image, std::uint16_t near, std::uint16_t far,
    ImageView<std::uint8_t> full)
{
  const DepthLevels level (near, far);
  paste (image.roi, full, [&] (int y, int begin, int end, std::uint8_t *to) {
    const std::uint16_t *from = image.depth.row (y);
    std::transform (from + begin, from + end, to,
        [&] (std::uint16_t z) { return static_cast<std::uint8_t> (level (z)); });
  });
}

void
paste_depth_map (
    const ConstRangeImage &image, std::uint16_t near, std::uint16_t far, ImageView<Rgbx> full)
{
  static constexpr std::array<Rgbx, 256> kTurbo = make_turbo ();
  const DepthLevels level (near, far);
  paste (image.roi, full, [&] (int y, int begin, int end, Rgbx *to) {
    const std::uint16_t *from = image.depth.row (y);
    std::transform (from + begin, from + end, to,
        [&] (std::uint16_t z) { return kTurbo[std::size_t (level (z))]; });
  });
}

void
swap_bytes (ImageView<const std::uint16_t> in, ImageView<std::uint16_t> out)
{
  for (int y = 0; y < in.height; y++)
    std::transform (in.row (y), in.row (y) + in.width, out.row (y),
        [] (std::uint16_t z) { return static_cast<std::uint16_t> (z << 8 | z >> 8); });
}

} // namespace rangecast
