/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>

namespace rangecast {

/** Finds the trigger that a camera's frame belongs to. One instance for each camera.
 *
 *  It combines the frame's number, which increases by one with each frame, and its time stamp,
 *  which follows the trigger by a fixed delay on the camera's own clock. Numbers alone would be off
 *  for good after a missed trigger, which cameras do not count; stamps alone would misplace a frame
 *  that a busy camera took late. If the two disagree, the stamp wins if it is within a quarter of
 *  a period of a trigger, and that one is at least half a period away from the numbered one. For
 * cameras without time stamps the arrival is used, which wins only after three equal disagreements.
 *
 *  Delay and number are learnt from triggers that were fired alone, when all before were answered
 * or given up: fire such ones until settled(), when two of them have agreed. Nothing is allocated.
 */
class TriggerMatcher {
public:
  /** @param period_ns  between two triggers, > 0; the scale of the tolerances */
  void start (std::int64_t period_ns);

  /** Records a trigger that was sent. Numbers and times increase.
   *  @param alone  no other trigger is pending */
  void fired (std::int64_t trigger, std::int64_t time_ns, bool alone);

  struct Found {
    bool known = false;           ///< false: the frame answers no known trigger
    std::int64_t trigger = 0;     ///< if known
    std::int64_t residual_ns = 0; ///< delay of the frame less the usual delay
  };

  /** @param frame_id   the camera's number, which does not wrap; 0: it has none
   *  @param camera_ns  the camera's time stamp; 0: it has none
   *  @param arrival_ns by the clock of fired() */
  Found find (std::uint64_t frame_id, std::int64_t camera_ns, std::int64_t arrival_ns);

  /** Enough is learnt to fire triggers continuously. */
  [[nodiscard]] bool settled () const { return settled_; }
  /** The camera is out of sync (restarted, its clock set): its frames match no trigger. Call
   * start() again. */
  [[nodiscard]] bool lost_sync () const { return unmatched_ >= kMaxUnmatched; }
  /** Settles for what is learnt so far, for a camera that does not answer single triggers. */
  void settle () { settled_ = learnt_; }

private:
  static constexpr int kTriggers = 64, kMaxUnmatched = 8, kMaxContradictions = 3;

  struct Trigger {
    std::int64_t number, time_ns;
  };

  [[nodiscard]] const Trigger *trigger_at (std::int64_t number) const;
  [[nodiscard]] Found nearest (std::int64_t time_ns) const;
  [[nodiscard]] bool by_id (std::uint64_t frame_id, std::int64_t &trigger) const;
  Found learn (std::uint64_t frame_id, std::int64_t time_ns);
  Found no_match ();
  void accept (std::uint64_t frame_id, const Found &found);

  std::int64_t period_ns_ = 1;
  std::array<Trigger, kTriggers> triggers_{};
  std::int64_t count_ = 0; ///< triggers fired
  bool alone_ = false;     ///< the last one was fired alone

  bool learnt_ = false, settled_ = false, stamped_ = false;
  std::int64_t delay_ns_ = 0; ///< from trigger to stamp, usually
  std::uint64_t last_id_ = 0;
  std::int64_t last_trigger_ = 0, learnt_trigger_ = -1;
  std::int64_t contradiction_ = 0; ///< triggers between arrival and number
  int contradictions_ = 0, unmatched_ = 0;
};

} // namespace rangecast
