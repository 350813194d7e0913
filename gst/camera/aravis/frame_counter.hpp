/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

/** Continues the frame ids of one stream as 64-bit numbers. GigE Vision has 16 bits without 0
 *  (65535 is followed by 1), or 64 bits from 1; USB3 Vision 64 bits from 0. */
class FrameCounter {
public:
  enum class Ids { kGigE, kUsb };

  explicit FrameCounter (Ids ids = Ids::kGigE) : ids_ (ids) {}

  /** Whether the standard allows such an id. */
  [[nodiscard]] bool is_id (std::uint64_t id) const { return ids_ == Ids::kUsb || id != 0; }
  /** The number of that id, from 0 for the standard's first id. Grows strictly: an id that cannot
   *  follow the last one (a camera that starts over, a leap) counts as the next. */
  std::uint64_t number (std::uint64_t id)
  {
    if (!begun_)
      number_ = id < kLeap ? id - (ids_ == Ids::kGigE) : 0;
    else
      number_ += step_to (id);
    begun_ = true;
    last_id_ = id;
    return number_;
  }

private:
  static constexpr std::uint64_t kRound = 65535;
  static constexpr std::uint64_t kLeap = std::uint64_t (1) << 31;

  [[nodiscard]] std::uint64_t step_to (std::uint64_t id) const
  {
    if (id > last_id_)
      return id - last_id_ < kLeap ? id - last_id_ : 1;
    if (ids_ == Ids::kGigE && last_id_ <= kRound && last_id_ - id > kRound / 2)
      return id + kRound - last_id_;
    return 1;
  }

  Ids ids_;
  bool begun_ = false;
  std::uint64_t last_id_ = 0, number_ = 0;
};
