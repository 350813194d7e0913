/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

/** Counts the frame ids of one stream on. GigE Vision has 16 bits without 0 (65535 is followed by
 * 1), or 64 bits from 1; USB3 Vision 64 bits from 0. */
class FrameCounter {
public:
  enum class Ids { kGigE, kUsb };

  explicit FrameCounter (Ids ids = Ids::kGigE) : ids_ (ids) {}

  /** The number of that id, 0 for the first id that there is. Ids come in order, with gaps of less
   *  than half their range; one that is not above the last one begins a new round. */
  std::uint64_t number (std::uint64_t id)
  {
    if (ids_ == Ids::kUsb)
      return id;
    if (id < last_id_ && last_id_ <= kRound && last_id_ - id > kRound / 2)
      rounds_ += kRound;
    last_id_ = id;
    return rounds_ + id - 1;
  }

private:
  static constexpr std::uint64_t kRound = 65535;

  Ids ids_;
  std::uint64_t last_id_ = 0, rounds_ = 0;
};
