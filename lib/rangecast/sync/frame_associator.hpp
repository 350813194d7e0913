/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace rangecast {

/** Cameras that one signal fires, which nobody here sees: finds the leading camera's frame that a
 *  frame of another one belongs to. One a camera but the leading one.
 *
 *  Mostly time tells: both were taken within half a period. Where cameras count alike, numbers
 * tell, too: their difference is learnt from frames whose times agree, and then finds the partner
 * of a frame whose stamp is wrong or that arrived late. A camera that misses a signal does not
 * count what it did not take, so a time that lies within a quarter of a period of another frame of
 * the leading camera wins: a stamp at once, an arrival when it says the same three times. Nothing
 * is allocated. */
class PartnerFinder {
public:
  /** @param period_ns  between two signals, > 0 */
  void start (std::int64_t period_ns);

  /** A frame of the leading camera. Numbers count up, and so do times mostly. */
  void leader (std::uint64_t number, std::int64_t taken_ns);

  /** When a frame of the other camera was taken, as far as is known now.
   *  @param taken_ns  by its time; absent: nothing tells
   *  @param stamped   that is the camera's stamp, not its arrival
   *  @return the leading camera's time where its number knows better; absent: nothing tells */
  std::optional<std::int64_t> place (
      std::uint64_t number, std::optional<std::int64_t> taken_ns, bool stamped);

  /** The cameras count alike, as far as was seen. */
  [[nodiscard]] bool learnt () const { return agreed_ >= kAgreed; }

private:
  static constexpr int kLeaders = 32, kAgreed = 8, kContradictions = 3;

  struct Leader {
    std::uint64_t number;
    std::int64_t taken_ns;
  };

  [[nodiscard]] const Leader *nearest (std::int64_t taken_ns) const;
  [[nodiscard]] const Leader *numbered (std::uint64_t number) const;
  void agree (std::int64_t difference);

  std::int64_t period_ns_ = 1;
  std::array<Leader, kLeaders> leaders_{};
  std::int64_t count_ = 0;
  std::int64_t difference_ = 0; ///< of the numbers: the leading camera's is so much less
  int agreed_ = 0;
  std::int64_t contradiction_ = 0;
  int contradictions_ = 0;
};

} // namespace rangecast
