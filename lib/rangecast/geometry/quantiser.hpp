/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "../base/status.hpp"
#include "rig.hpp"

namespace rangecast {

/** What depth codes are linear in, between near and far. */
enum class DepthScale : std::uint8_t {
  kLinear,  ///< in depth
  kInverse, ///< in 1 / depth: steps grow with the square of the depth, as errors of stereo do
};

/** Depth to codes of `bits` bits and back; near is code 0 and far the greatest, on either scale.
 *  Formulas: docs/formats/bitstream.md, "Quantisation". Codes beyond those that make every depth
 * unit a code of its own are not used; then nothing is lost. On the inverse scale several codes may
 * have one depth: code() gives the least of them, decoders take all. Tables: 128 KiB and up to 128
 * KiB more. */
class DepthQuantiser {
public:
  /** @param near, far  depth units, 1 <= near < far; @param bits  6 to 16 */
  Status set (
      std::uint16_t near, std::uint16_t far, int bits, DepthScale scale = DepthScale::kLinear);
  /** The view's near and far. */
  Status set (const View &view, int bits, DepthScale scale = DepthScale::kLinear);

  /** Depth units in near..far. */
  [[nodiscard]] bool valid (std::uint16_t depth) const { return depth >= near_ && depth <= far_; }
  /** Of a valid depth. Greater depths have no smaller codes. */
  [[nodiscard]] std::uint16_t code (std::uint16_t depth) const { return codes_[depth]; }
  /** Of a code below codes(). */
  [[nodiscard]] std::uint16_t depth (std::uint16_t code) const { return depths_[code]; }
  /** Codes that depths have: decoders refuse others. */
  [[nodiscard]] int codes () const { return static_cast<int> (depths_.size ()); }
  /** Depth units by which a depth changes at most where its code changes by up to `threshold`; of
   *  0: by quantisation alone. Looks at all depths. */
  [[nodiscard]] int max_error (int threshold = 0) const;
  /** Depth units from one code to the next, at far, where it is most. */
  [[nodiscard]] double step () const { return step_; }

private:
  void fill_linear (std::uint32_t last);
  void fill_inverse (std::uint32_t last);

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
