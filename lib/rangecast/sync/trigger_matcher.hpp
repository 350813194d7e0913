/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>

namespace rangecast {

/** Finds the trigger ("shot") that a camera's frame answers. One a camera.
 *
 *  Two things tell: the frame's number, which grows by one a frame, and its time stamp, which lies
 * one fixed delay after the trigger on the camera's own clock. Numbers alone would shift for good
 * when a camera misses a trigger, because it does not count what it did not take; stamps alone
 * would shift a frame that a busy camera took late. So numbers and stamps are compared, and where
 * they differ the stamp wins if it lies within a quarter of a period of a trigger. Cameras without
 * time stamps are known by arrival, which wins only when it says the same thing three times.
 *
 *  What is fixed is learnt from shots that were fired alone, with all before answered or given up:
 *  fire such ones until settled() says that two of them agreed. Nothing is allocated. */
class ShotFinder {
public:
  /** @param period_ns  between two shots, > 0; decides what is near */
  void start (std::int64_t period_ns);

  /** A trigger went out. Shots count up; so do times.
   *  @param alone  no other shot is under way */
  void fired (std::int64_t shot, std::int64_t time_ns, bool alone);

  struct Found {
    bool known = false;           ///< else the frame answers no shot that is known
    std::int64_t shot = 0;        ///< if known
    std::int64_t residual_ns = 0; ///< how late the frame is against its usual delay
  };

  /** @param frame_id   the camera's number; 16 bits without 0, or 64; 0: it has none
   *  @param camera_ns  the camera's time stamp; 0: it has none
   *  @param arrival_ns by the clock of fired() */
  Found find (std::uint64_t frame_id, std::int64_t camera_ns, std::int64_t arrival_ns);

  /** Enough is learnt to fire one shot after the other. */
  [[nodiscard]] bool settled () const { return settled_; }
  /** The camera lost step (restarted, its clock set): frames are not known. start() again. */
  [[nodiscard]] bool lost_step () const { return strangers_ >= kMaxStrangers; }
  /** A camera that does not answer lone shots is settled by what it said so far. */
  void settle () { settled_ = learnt_; }

private:
  static constexpr int kShots = 64, kMaxStrangers = 8, kMaxContradictions = 3;

  struct Shot {
    std::int64_t number, time_ns;
  };

  [[nodiscard]] const Shot *shot_at (std::int64_t number) const;
  [[nodiscard]] Found nearest (std::int64_t time_ns) const;
  [[nodiscard]] bool by_id (std::uint64_t frame_id, std::int64_t &shot) const;
  Found learn (std::uint64_t frame_id, std::int64_t time_ns);
  Found stranger ();
  void accept (std::uint64_t frame_id, const Found &found);

  std::int64_t period_ns_ = 1;
  std::array<Shot, kShots> shots_{};
  std::int64_t count_ = 0; ///< shots fired
  bool alone_ = false;     ///< the last one was fired alone

  bool learnt_ = false, settled_ = false, stamped_ = false;
  std::int64_t delay_ns_ = 0; ///< from trigger to stamp, usually
  std::uint64_t last_id_ = 0;
  std::int64_t last_shot_ = 0, learnt_shot_ = -1;
  std::int64_t contradiction_ = 0; ///< by how many shots arrival differs from the number
  int contradictions_ = 0, strangers_ = 0;
};

/** How far one frame number lies behind another: 16-bit numbers go from 65535 to 1.
 *  @return 1 for the next one, 0 if it is the same, negative if it is older */
std::int64_t frame_id_step (std::uint64_t from, std::uint64_t to);

} // namespace rangecast
