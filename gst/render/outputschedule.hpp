/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <utility>

/** Of an output. */
struct FrameRate {
  int n = 0, d = 1;       ///< pictures a second; 0/1: none
  bool is_inputs = false; ///< frame sets have the same
};

/** When an output with a frame rate of its own has pictures, and which frame set each of them
 * shows.
 *
 *  Pictures are at whole multiples of the output's period, counted from stream position 0: the same
 *  moments wherever a stream was entered. A picture shows the newest frame set that is no more than
 *  a quarter of a period after it, so that times that are not quite even neither repeat a frame set
 *  nor skip one. Holds no lock: whoever shares it between threads does. Allocates nothing. */
class PictureGrid {
public:
  /** Pictures a second; beyond that the grid is finer than times can be. */
  static constexpr int kMaxRate = 1000;
  /** ns: longer durations and holes of a stream are more likely errors than meant; each would be
   *  filled with pictures. */
  static constexpr GstClockTime kLongest = 60 * GST_SECOND;

  PictureGrid () = default;
  PictureGrid (const PictureGrid &) = delete;
  PictureGrid &operator= (const PictureGrid &) = delete;
  ~PictureGrid () { reset (); }

  /** Pictures a second; 0/1: none, the output follows the frame sets. */
  void set_rate (int n, int d);
  [[nodiscard]] bool active () const { return rate_n_ > 0; }
  /** ns from one picture to the next; 0 if not active */
  [[nodiscard]] GstClockTime period () const;
  /** ns by which a frame set may be after the picture that shows it */
  [[nodiscard]] GstClockTime tolerance () const { return period () / 4; }
  /** For how long after its own duration a frame set is shown that none follows, ns;
   *  GST_CLOCK_TIME_NONE: for ever. But where no clock limits how many pictures there are, no
   *  longer than kLongest. */
  void set_hold (GstClockTime hold) { hold_ = hold; }
  void set_live (bool live) { live_ = live; }

  /** Forgets all frame sets; the next picture may be anywhere. */
  void reset ();
  /** Forgets all frame sets; the next picture is after the last one. */
  void drop_frame_sets ();
  /** There was a picture, not of this grid, at that stream position. */
  void begin_after (GstClockTime pts) { foreign_ = pts; }
  /** Stream position of the last picture of the grid, or GST_CLOCK_TIME_NONE */
  [[nodiscard]] GstClockTime last () const { return last_; }
  /** Stream position at which that picture ends; 0: there was none. */
  [[nodiscard]] GstClockTime covered () const { return covered_; }

  /** The next frame set of the stream. Times that go back a little count as the last one's; if by
   *  more than the frame set's duration, those that lie in its future are forgotten: their times
   *  were wrong, and would keep back all that follows. The oldest one that waits to be shown gives
   *  way where too many do. One that is more than G_MAXINT64 ns, 292 years, from the stream's
   *  beginning is dropped.
   *  @param frame_set  transfer full; without PTS it follows the last one at once
   *  @param duration   ns, kLongest counts for more; 0 or GST_CLOCK_TIME_NONE: the output's period
   */
  void add (GstBuffer *frame_set, GstClockTime duration);

  [[nodiscard]] bool holds_any () const { return count_ > 0; }
  /** Stream position, ns: no frame set that comes is before this. */
  [[nodiscard]] GstClockTime known_until () const;
  /** Stream position at which the newest frame set ends, ns. */
  [[nodiscard]] GstClockTime end () const;
  /** What take() is to be told when no frame set follows: has all pictures before that end, without
   *  the wait for a frame set that might come just after a picture's time. */
  [[nodiscard]] GstClockTime until_the_end () const;

  /** Frame sets that are held, the oldest first, for whoever puts copies in their place. */
  [[nodiscard]] std::size_t frame_sets () const { return count_; }
  /** Returns: (transfer none) */
  [[nodiscard]] GstBuffer *frame_set (std::size_t i) const { return at (i).buffer; }
  /** @param copy  transfer full. Returns: (transfer full): what was there */
  GstBuffer *exchange_frame_set (std::size_t i, GstBuffer *copy)
  {
    return std::exchange (at (i).buffer, copy);
  }

  /** Stream position of the next picture, ns, or GST_CLOCK_TIME_NONE if nothing is held for one. */
  [[nodiscard]] GstClockTime next_pts () const;

  struct Picture {
    GstBuffer *frame_set = nullptr; ///< transfer none, until the next call
    GstClockTime pts = 0;           ///< stream position, ns
    GstClockTime duration = 0;      ///< ns
    bool gap = false;               ///< there is no picture right before this one
  };
  /** Takes the next picture if the frame set that it shows is sure, now that none before `until`
   *  (stream position, ns) can come any more.
   *  @return false if there is none */
  bool take (GstClockTime until, Picture &picture);

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
  void drop (std::size_t i);
  [[nodiscard]] GstClockTime slack (const FrameSet &set) const;
  [[nodiscard]] GstClockTime first_showing (const FrameSet &set) const;
  [[nodiscard]] GstClockTime first_after (GstClockTime pts) const;
  bool find (GstClockTime &pts, std::size_t &index) const;
  [[nodiscard]] GstClockTime hold () const { return live_ ? hold_ : std::min (hold_, kLongest); }

  int rate_n_ = 0, rate_d_ = 1;
  GstClockTime hold_ = GST_CLOCK_TIME_NONE;
  bool live_ = false;
  GstClockTime last_ = GST_CLOCK_TIME_NONE;    /* picture that was taken */
  GstClockTime covered_ = 0;                   /* where that one ends */
  GstClockTime foreign_ = GST_CLOCK_TIME_NONE; /* last picture that was not of the grid */
  std::array<FrameSet, 64> ring_{};            /* the oldest first */
  std::size_t first_ = 0, count_ = 0;
};
