/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../status.hpp"
#include "rig.hpp"

namespace rangecast {

/** Depth to codes of `bits` bits and back, linear in depth between near and far. Where the range
 *  has no more units than there are codes, every unit has its own and nothing is lost.
 *  Else code = round ((depth - near) * (codes - 1) / (far - near)).
 *  Tables: 128 KiB and up to 128 KiB more. */
class DepthQuantiser {
public:
  /** @param near, far  depth units, 1 <= near < far; @param bits  6 to 16 */
  Status set (std::uint16_t near, std::uint16_t far, int bits);
  /** The view's near and far. */
  Status set (const View &view, int bits);

  /** Depth units in near..far. */
  [[nodiscard]] bool valid (std::uint16_t depth) const { return depth >= near_ && depth <= far_; }
  /** Of a valid depth. */
  [[nodiscard]] std::uint16_t code (std::uint16_t depth) const { return codes_[depth]; }
  /** Of a code below codes(). */
  [[nodiscard]] std::uint16_t depth (std::uint16_t code) const { return depths_[code]; }
  /** Codes that depths have: decoders refuse others. */
  [[nodiscard]] int codes () const { return static_cast<int> (depths_.size ()); }
  /** Depth units by which quantisation changes a depth at most. */
  [[nodiscard]] int max_error () const { return max_error_; }
  /** Depth units that one code stands for, rounded up; 1 if nothing is lost. */
  [[nodiscard]] double step () const { return step_; }

private:
  std::uint16_t near_ = 0, far_ = 0;
  int max_error_ = 0;
  double step_ = 1;
  std::vector<std::uint16_t> codes_, depths_;
};

/** One colour channel to codes of `bits` bits and back:
 *  code = round (value * (2^bits - 1) / 255), value = round (code * 255 / (2^bits - 1)). */
class ColourQuantiser {
public:
  explicit ColourQuantiser (int bits = 8);
  [[nodiscard]] std::uint8_t code (std::uint8_t value) const { return codes_[value]; }
  [[nodiscard]] std::uint8_t value (std::uint8_t code) const { return values_[code]; }
  [[nodiscard]] int bits () const { return bits_; }

private:
  int bits_;
  std::array<std::uint8_t, 256> codes_{}, values_{};
};

} // namespace rangecast
