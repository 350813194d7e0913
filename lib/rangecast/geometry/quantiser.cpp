/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "quantiser.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace rangecast {

Status
DepthQuantiser::set (std::uint16_t near, std::uint16_t far, int bits)
{
  if (near < 1 || far <= near || bits < 6 || bits > 16)
    return {StatusCode::kBadValue, "depth quantiser: expected 1 <= near < far and 6 to 16 bits"};
  const std::uint32_t range = far - near;
  const std::uint32_t last = std::min (range, (1u << bits) - 1); /* the greatest code */
  near_ = near;
  far_ = far;
  step_ = double (range) / last;
  codes_.assign (65536, 0);
  depths_.resize (last + 1);
  for (std::uint32_t code = 0; code <= last; code++)
    depths_[code] =
        static_cast<std::uint16_t> (near + (code * std::uint64_t{range} + last / 2) / last);
  max_error_ = 0;
  for (std::uint32_t d = near; d <= far; d++) {
    codes_[d] = static_cast<std::uint16_t> (((d - near) * std::uint64_t{last} + range / 2) / range);
    max_error_ = std::max (max_error_, std::abs (int (depths_[codes_[d]]) - int (d)));
  }
  return {};
}

Status
DepthQuantiser::set (const View &view, int bits)
{
  const auto units = [&] (double metres) {
    return static_cast<std::uint16_t> (
        std::clamp (std::round (metres / view.depth_unit_m), 1.0, 65535.0));
  };
  Status status = set (units (view.near_m), units (view.far_m), bits);
  if (!status.ok ())
    return {status.code (),
        "view " + std::to_string (view.id) + ": near and far are less than one depth unit apart"};
  return status;
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
