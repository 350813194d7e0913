/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <utility>

/** Frame rate of the output's caps. */
struct FrameRate {
  int n = 0, d = 1;       ///< pictures a second; 0/1: none
  bool is_inputs = false; ///< the input's caps have the same
};

/** When an output with a frame rate of its own has pictures, and which frame set each of them
 *  shows.
 *
 *  Pictures are at whole multiples of the output's period, counted from stream position 0: the same
 *  moments wherever a stream was entered. A picture shows the newest frame set that is no more than
 *  a quarter of a period after it, so that slightly uneven times neither repeat a frame set nor
 *  skip one. Has no lock: callers share it between threads under theirs. Allocates nothing. */
class OutputSchedule {
public:
  /** Pictures a second; above that a period is too short for times in ns. */
  static constexpr int kMaxRate = 1000;
  /** ns: longer durations and gaps of a stream are probably wrong; each would be filled with
   *  pictures. */
  static constexpr GstClockTime kMaxDuration = 60 * GST_SECOND;

  OutputSchedule () = default;
  OutputSchedule (const OutputSchedule &) = delete;
  OutputSchedule &operator= (const OutputSchedule &) = delete;
  ~OutputSchedule () { reset (); }

  /** Pictures a second; 0/1, or above kMaxRate: not active, the output follows the frame sets. */
  void set_rate (int n, int d);
  [[nodiscard]] bool active () const { return rate_n_ > 0; }
  /** ns from one picture to the next; 0 if not active */
  [[nodiscard]] GstClockTime period () const;
  /** ns by which a frame set may be after the picture that shows it */
  [[nodiscard]] GstClockTime tolerance () const { return period () / 4; }
  /** For how long after its own duration the last frame set is shown, ns; GST_CLOCK_TIME_NONE:
   *  forever. If not live, where no clock limits the number of pictures, kMaxDuration at most. */
  void set_hold (GstClockTime hold) { hold_ = hold; }
  void set_live (bool live) { live_ = live; }

  /** Removes all frame sets; the next picture may be anywhere. */
  void reset ();
  /** Removes all frame sets; the next picture is after the last one. */
  void remove_frame_sets ();

  /** Adds the next frame set of the stream. One before its predecessor counts as of the same time;
   *  if it is earlier by more than its duration, the predecessor's time was wrong: that one is
   *  removed, because it would delay all that follow. If too many wait, the oldest of them is
   *  removed. A frame set more than G_MAXINT64 ns, 292 years, from the stream's beginning is
   *  dropped.
   *  @param frame_set  transfer full; without PTS it follows the last one at once
   *  @param duration   ns, at most kMaxDuration counts; 0 or GST_CLOCK_TIME_NONE: the period
   *  @return how many frame sets were removed or dropped without ever being shown */
  guint add (GstBuffer *frame_set, GstClockTime duration);
  /** A picture that is not of this schedule is at that stream position: later ones follow it. */
  void begin_after (GstClockTime pts) { unscheduled_ = pts; }

  /** Number of frame sets that are held, the oldest first. */
  [[nodiscard]] std::size_t frame_sets () const { return count_; }
  /** Returns: (transfer none) */
  [[nodiscard]] GstBuffer *frame_set (std::size_t i) const { return at (i).buffer; }
  /** @param copy  transfer full. Returns: (transfer full): what it replaces */
  GstBuffer *replace_frame_set (std::size_t i, GstBuffer *copy)
  {
    return std::exchange (at (i).buffer, copy);
  }

  /** Stream position, ns: no frame set that comes is before this. */
  [[nodiscard]] GstClockTime known_until () const;
  /** The limit for next() when no frame set follows: includes all pictures before the end of the
   *  newest one, without waiting for a frame set just after a picture's time. */
  [[nodiscard]] GstClockTime drain_limit () const;

  struct Picture {
    GstBuffer *frame_set = nullptr; ///< transfer none, until the next call
    GstClockTime pts = 0;           ///< stream position, ns
    GstClockTime duration = 0;      ///< ns
    bool discont = false;           ///< there is no picture right before this one
  };
  /** Stream position of the next picture, ns; GST_CLOCK_TIME_NONE if no frame set is held for one.
   */
  [[nodiscard]] GstClockTime next_pts () const;
  /** Removes the next picture from the schedule if its frame set is certain, given that no frame
   *  set before `limit` (stream position, ns) follows. @return false if there is none */
  bool next (GstClockTime limit, Picture &picture);
  /** Stream position of the last picture from next(), or GST_CLOCK_TIME_NONE */
  [[nodiscard]] GstClockTime last () const { return last_; }
  /** Stream position at which that picture ends; 0: there was none. */
  [[nodiscard]] GstClockTime covered () const { return covered_; }

private:
  struct FrameSet {
    GstBuffer *buffer;
    GstClockTime begin, end; /* stream position */
  };
  FrameSet &at (std::size_t i) { return ring_[(first_ + i) % ring_.size ()]; }
  [[nodiscard]] const FrameSet &at (std::size_t i) const
  {
    return ring_[(first_ + i) % ring_.size ()];
  }
  void remove (std::size_t i);
  [[nodiscard]] GstClockTime end () const { return count_ > 0 ? at (count_ - 1).end : 0; }
  [[nodiscard]] GstClockTime slack (const FrameSet &set) const;
  [[nodiscard]] GstClockTime first_showing (const FrameSet &set) const;
  [[nodiscard]] GstClockTime first_after (GstClockTime pts) const;
  bool find (GstClockTime &pts, std::size_t &index) const;

  int rate_n_ = 0, rate_d_ = 1;
  GstClockTime hold_ = GST_CLOCK_TIME_NONE;
  bool live_ = false;
  GstClockTime last_ = GST_CLOCK_TIME_NONE;        /* picture that next() returned */
  GstClockTime covered_ = 0;                       /* where that one ends */
  GstClockTime unscheduled_ = GST_CLOCK_TIME_NONE; /* see begin_after() */
  std::array<FrameSet, 64> ring_{};                /* the oldest first */
  std::size_t first_ = 0, count_ = 0;
};
