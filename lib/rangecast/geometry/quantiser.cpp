/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "quantiser.hpp"

#include <algorithm>

#include "point_cloud.hpp"

namespace rangecast {

Status
DepthQuantiser::set (std::uint16_t near, std::uint16_t far, int bits)
{
  if (near < 1 || far <= near || bits < 6 || bits > 16)
    return {StatusCode::kBadValue, "depth quantiser: needs 1 <= near < far and 6 to 16 bits"};
  const std::uint32_t range = far - near, last = std::min (range, (1u << bits) - 1);
  near_ = near;
  far_ = far;
  step_ = double (range) / last;
  codes_.assign (65536, 0);
  depths_.resize (last + 1);
  for (std::uint32_t code = 0; code <= last; code++)
    depths_[code] =
        static_cast<std::uint16_t> (near + (code * std::uint64_t{range} + last / 2) / last);
  for (std::uint32_t d = near; d <= far; d++)
    codes_[d] = static_cast<std::uint16_t> (((d - near) * std::uint64_t{last} + range / 2) / range);
  return {};
}

Status
DepthQuantiser::set (const View &view, int bits)
{
  Status status = set (depth_units (view.near_m, view.depth_unit_m),
      depth_units (view.far_m, view.depth_unit_m), bits);
  if (!status.ok ())
    return {status.code (),
        "view " + std::to_string (view.id) + ": near and far are less than one depth unit apart"};
  return status;
}

int
DepthQuantiser::max_error (int threshold) const
{
  const int last = codes () - 1;
  int error = 0;
  for (int d = near_; d <= far_ && last > 0; d++) {
    const int code = codes_[static_cast<std::size_t> (d)];
    const int low = depths_[static_cast<std::size_t> (std::max (code - threshold, 0))];
    const int high = depths_[static_cast<std::size_t> (std::min (code + threshold, last))];
    error = std::max ({error, d - low, high - d});
  }
  return error;
}

ColourQuantiser::ColourQuantiser (int bits) : bits_ (std::clamp (bits, 1, 8))
{
  const int last = (1 << bits_) - 1;
  for (int v = 0; v < 256; v++)
    codes_[v] = static_cast<std::uint8_t> ((v * last + 127) / 255);
  for (int c = 0; c <= last; c++)
    values_[c] = static_cast<std::uint8_t> ((c * 255 + last / 2) / last);
}

} // namespace rangecast
