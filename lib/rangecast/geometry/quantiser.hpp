/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../base/status.hpp"
#include "rig.hpp"

namespace rangecast {

/** Depth to codes of `bits` bits and back; near is code 0 and far the greatest. Formulas:
 *  docs/formats/bitstream.md, "Quantisation". There are no more codes than lossless quantisation
 *  needs. Tables: 128 KiB and up to 128 KiB more. */
class DepthQuantiser {
public:
  /** @param near, far  depth units, 1 <= near < far; @param bits  6 to 16 */
  Status set (std::uint16_t near, std::uint16_t far, int bits);
  /** The view's near and far. */
  Status set (const View &view, int bits);

  /** Whether a depth, depth units, is in near..far. */
  [[nodiscard]] bool valid (std::uint16_t depth) const { return depth >= near_ && depth <= far_; }
  /** The code of a valid depth; monotonic. */
  [[nodiscard]] std::uint16_t code (std::uint16_t depth) const { return codes_[depth]; }
  /** The depth of a code below codes(), depth units. */
  [[nodiscard]] std::uint16_t depth (std::uint16_t code) const { return depths_[code]; }
  /** Number of codes; decoders refuse others. */
  [[nodiscard]] int codes () const { return static_cast<int> (depths_.size ()); }
  /** Greatest change of a depth, depth units, by quantisation and a change of its code by up to
   *  `threshold`. Examines all depths. */
  [[nodiscard]] int max_error (int threshold = 0) const;
  /** Depth units from one code to the next. */
  [[nodiscard]] double step () const { return step_; }

private:
  std::uint16_t near_ = 0, far_ = 0;
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
