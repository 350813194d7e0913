/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rangecast {

/** Converts the time stamps of a camera with its own clock to the host's clock: the least delay
 *  between stamp and arrival within the last windows is assumed to be that of an undelayed frame.
 *  Jitter of the host and of the network then has no effect, and the drift of the camera's clock
 * (100 ppm are 1 ms in 10 s) is followed. One instance for each camera; nothing is allocated. */
class CameraClock {
public:
  void reset () { *this = {}; }

  /** Capture time plus the least delay, ns of the host's clock.
   *  @param camera_ns  the camera's time stamp; 0: none, then the result is the arrival
   *  @param arrival_ns on the host's clock */
  std::int64_t host_time (std::int64_t camera_ns, std::int64_t arrival_ns);

private:
  static constexpr int kWindows = 4, kWindowFrames = 64;

  std::array<std::int64_t, kWindows> min_{}; ///< least delay of each window, ns
  int windows_ = 0, current_ = 0, in_window_ = 0;
  std::int64_t last_camera_ns_ = 0;
};

/** The last kMax values, for their median and other quantiles. Nothing is allocated. */
class RecentValues {
public:
  static constexpr std::size_t kMax = 512;

  void reset () { count_ = 0; }
  void add (std::int64_t value) { values_[count_++ % kMax] = value; }
  [[nodiscard]] bool empty () const { return count_ == 0; }
  /** Nearest rank. @param share  0 to 1 @return 0 if there are no values */
  [[nodiscard]] std::int64_t quantile (double share) const;

private:
  std::array<std::int64_t, kMax> values_{};
  std::uint64_t count_ = 0;
};

} // namespace rangecast
