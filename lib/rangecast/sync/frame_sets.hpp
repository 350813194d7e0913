/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>

namespace rangecast {

inline constexpr int kMaxCameras = 3; ///< left, right, third

/** Combines the frames of two or three cameras that belong together. A frame has a key: the number
 *  of its trigger, or its time. Keys of one camera increase. The number of waiting frames is
 * bounded; nothing is allocated. */
class FrameSets {
public:
  using Frame = void *; ///< owned by the caller; null: lost, its partners need not wait

  /** @param cameras    2 to kMaxCameras
   *  @param tolerance  how far the keys of one set may lie apart: 0 for trigger numbers
   *  @param waiting    frames of one camera that may wait for partners, 1 to kMaxWaiting */
  void start (int cameras, std::int64_t tolerance, int waiting = kMaxWaiting);

  struct Set {
    std::array<Frame, kMaxCameras> frames{}; ///< by camera; returned to the caller
    std::array<std::int64_t, kMaxCameras> keys{};
  };

  enum class Step {
    kWait, ///< no set yet
    kSet,  ///< one frame of each camera
    kDrop, ///< frames that will have no partner; some may be null
  };

  /** Adds a frame. The caller must call next() afterwards until it returns kWait.
   *  @return null, or the frame itself if it is refused, because its key did not increase or next()
   *  was not called: it is returned to the caller and counted as dropped */
  [[nodiscard]] Frame put (int camera, std::int64_t key, Frame frame);
  Step next (Set &set);
  /** Changes the tolerance, for keys that are times. */
  void set_tolerance (std::int64_t tolerance) { tolerance_ = tolerance; }
  /** Returns waiting frames to the caller. To be repeated until it returns kWait instead of kDrop.
   */
  Step drain (Set &set);

  /** Frames dropped so far, without lost ones (null). */
  [[nodiscard]] std::uint64_t dropped (int camera) const { return lanes_[camera].dropped; }

  /** A partner more than so many frames late is not waited for. */
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
  void pop_head (int camera, Set &set);

  std::array<Lane, kMaxCameras> lanes_{};
  int cameras_ = 2, waiting_ = kMaxWaiting;
  std::int64_t tolerance_ = 0;
};

} // namespace rangecast
