/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>

namespace rangecast {

inline constexpr int kMaxCameras = 3; ///< left, right, third

/** Puts the frames of two or three cameras together that belong to one moment. A frame has a key:
 *  the number of its trigger, or its time. Keys of one camera grow. What waits is bounded,
 *  nothing is allocated. */
class FrameSets {
public:
  using Frame = void *; ///< the caller's; null: it was lost, its partners need not wait

  /** @param cameras    2 to kMaxCameras
   *  @param tolerance  how far the keys of one set may lie apart: 0 for trigger numbers
   *  @param waiting    frames of one camera that may wait for partners, 1 to kMaxWaiting */
  void start (int cameras, std::int64_t tolerance, int waiting = kMaxWaiting);

  struct Set {
    std::array<Frame, kMaxCameras> frames{}; ///< by camera; the caller's again
    std::array<std::int64_t, kMaxCameras> keys{};
  };

  enum class Step {
    kWait, ///< nothing to hand out
    kSet,  ///< one frame of each camera
    kDrop, ///< frames (not null ones only) that will have no partner
  };

  /** Follow it with next() until that says kWait.
   *  @return null, or the frame itself if it is one too many: its key did not grow, or next() was
   *  not called. It is the caller's again, and counted as dropped */
  [[nodiscard]] Frame put (int camera, std::int64_t key, Frame frame);
  Step next (Set &set);
  /** For keys that are times: from now on. */
  void set_tolerance (std::int64_t tolerance) { tolerance_ = tolerance; }
  /** Everything that waits, one call after the other: to let it go. @return kDrop or kWait */
  Step take_rest (Set &set);

  /** Frames without partner so far; lost ones (null) are not among them. */
  [[nodiscard]] std::uint64_t dropped (int camera) const { return lanes_[camera].dropped; }

  /** A partner that comes more than so many frames behind never comes. */
  static constexpr int kMaxWaiting = 8;

private:
  struct Waiting {
    std::int64_t key;
    Frame frame;
  };
  struct Lane {
    std::array<Waiting, kMaxWaiting + 1> ring{};
    int first = 0, count = 0;
    std::int64_t last_key = 0;
    bool has_last = false;
    std::uint64_t dropped = 0;
  };

  [[nodiscard]] const Waiting &head (int camera) const
  {
    return lanes_[camera].ring[lanes_[camera].first];
  }
  void drop_head (int camera, Set &set);
  void take_head (int camera, Set &set);
  [[nodiscard]] bool complete (int &oldest) const;

  std::array<Lane, kMaxCameras> lanes_{};
  int cameras_ = 2, waiting_ = kMaxWaiting;
  std::int64_t tolerance_ = 0;
};

} // namespace rangecast
