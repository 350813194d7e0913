/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "slice_partition.hpp"

#include <algorithm>
#include <cmath>

#include "symbols.hpp"

namespace rangecast {
namespace {

/* A slice has so many columns for each byte^(1/2) of its size; found by trying. In entropy slices
 * are about as wide as high, so that few pixels lack their upper neighbours; packed would rather
 * begin few runs. Without loss rows are long and slices low. */
double
columns_of_slice (Profile profile, bool is_exact)
{
  if (profile == Profile::kPacked)
    return is_exact ? 1.4 : 4.5;
  return is_exact ? 1 : 2.4;
}

/* How full slices with a reference are meant to be: then few of them break in their band. */
constexpr double kFillOfDeltaSlice = 0.8;

} // namespace

int
plain_pieces (const SliceHeader &header, int max_slice_size)
{
  const int bits = kSymbolBits + header.depth_bits + 3 * header.colour_bits;
  /* Symbols and full pixels may each end within a byte; slices that refer to others have a longer
   * header. */
  const int around = int (kSliceHeaderSize) + 2 + header.reference;
  const int most = (max_slice_size - around) * 8 / bits;
  return (header.roi.width + most - 1) / most;
}

/* Slices about as wide as high; but with a reference they are as high as their band, if last time
 * is anything to go by. */
int
compact_pieces (const SliceHeader &header, const RowBand &band, int max_slice_size, bool is_exact,
    double delta_bytes_per_pixel)
{
  const int width = header.roi.width;
  double side = columns_of_slice (header.profile, is_exact) * std::sqrt (max_slice_size);
  if (!band.key && delta_bytes_per_pixel > 0) {
    const double columns = kFillOfDeltaSlice * max_slice_size / (delta_bytes_per_pixel * band.rows);
    side = std::clamp (columns, side, double (std::max (width, int (side) + 1)));
  }
  return std::clamp (int (std::lround (width / side)), 1, width);
}

} // namespace rangecast
