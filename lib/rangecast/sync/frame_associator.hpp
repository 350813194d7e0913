/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace rangecast {

/** For cameras that are triggered by one external signal, which this host does not see: finds the
 *  leading camera's frame that a frame of another camera belongs to. One instance for each camera
 * but the leading one.
 *
 *  Usually times suffice: those of partners differ by less than half a period. Frame numbers help
 *  too: their difference is learnt from frames whose times agree, and then finds the partner of a
 *  frame whose stamp is wrong or that arrived late. A camera does not count signals that it missed,
 *  so a time within a quarter of a period of another frame of the leading camera overrides the
 *  number: a stamp at once, an arrival when it has disagreed the same way three times. Nothing is
 *  allocated. */
class FrameAssociator {
public:
  /** @param period_ns  between two signals, > 0 */
  void start (std::int64_t period_ns);

  /** Records a frame of the leading camera. Numbers increase, and usually times. */
  void leader (std::uint64_t number, std::int64_t taken_ns);

  /** Capture time of a frame of the other camera.
   *  @param taken_ns  from its stamp or arrival; absent: unknown
   *  @param stamped   taken_ns is the camera's stamp, not its arrival
   *  @return taken_ns, or the leading camera's time if the number is more reliable; absent: unknown
   */
  std::optional<std::int64_t> place (
      std::uint64_t number, std::optional<std::int64_t> taken_ns, bool stamped);

  /** The difference of the numbers is known. */
  [[nodiscard]] bool learnt () const { return agreed_ >= kAgreed; }

private:
  static constexpr int kLeaders = 32, kAgreed = 8, kContradictions = 3;

  struct Leader {
    std::uint64_t number;
    std::int64_t taken_ns;
  };

  [[nodiscard]] const Leader *nearest (std::int64_t taken_ns) const;
  [[nodiscard]] const Leader *numbered (std::uint64_t number) const;

  std::int64_t period_ns_ = 1;
  std::array<Leader, kLeaders> leaders_{};
  std::int64_t count_ = 0;
  std::int64_t difference_ = 0; ///< of the numbers: the leading camera's is so much less
  int agreed_ = 0;
  std::int64_t contradiction_ = 0;
  int contradictions_ = 0;
};

} // namespace rangecast
