/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "outputschedule.hpp"

namespace {

GstClockTime
later_by (GstClockTime time, GstClockTime more)
{
  return GST_CLOCK_TIME_IS_VALID (more) && time < G_MAXINT64 && more < G_MAXINT64
             ? time + more
             : GST_CLOCK_TIME_NONE;
}

} // namespace

void
OutputSchedule::set_rate (int n, int d)
{
  rate_n_ = gst_util_fraction_compare (n, std::max (d, 1), kMaxRate, 1) > 0 ? 0 : n;
  rate_d_ = std::max (d, 1);
}

GstClockTime
OutputSchedule::period () const
{
  return active () ? gst_util_uint64_scale (GST_SECOND, guint64 (rate_d_), guint64 (rate_n_)) : 0;
}

/* ---- input ---- */

guint
OutputSchedule::add (GstBuffer *frame_set, GstClockTime duration)
{
  guint removed = 0;
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = period ();
  duration = std::min (duration, kMaxDuration);
  GstClockTime begin = GST_BUFFER_PTS (frame_set);
  if (!GST_CLOCK_TIME_IS_VALID (begin))
    begin = end ();
  for (; later_by (begin, duration) < known_until (); removed++)
    remove (count_ - 1);
  begin = std::max (begin, known_until ());
  if (begin >= G_MAXINT64) {
    gst_buffer_unref (frame_set);
    return removed + 1;
  }
  if (count_ == ring_.size ()) {
    remove (1); /* the first one is on the screen */
    removed++;
  }
  at (count_++) = {frame_set, begin, begin + duration};
  return removed;
}

void
OutputSchedule::remove (std::size_t i)
{
  gst_clear_buffer (&at (i).buffer);
  for (; i > 0; i--)
    at (i) = at (i - 1);
  at (0).buffer = nullptr;
  first_ = (first_ + 1) % ring_.size ();
  count_--;
}

void
OutputSchedule::remove_frame_sets ()
{
  while (count_ > 0)
    remove (0);
}

void
OutputSchedule::reset ()
{
  remove_frame_sets ();
  unscheduled_ = GST_CLOCK_TIME_NONE;
  last_ = GST_CLOCK_TIME_NONE;
  covered_ = 0;
}

GstClockTime
OutputSchedule::known_until () const
{
  return count_ > 0 ? at (count_ - 1).begin : 0;
}

/* ---- output ---- */

/* Minimum time of a picture before the end of the frame set that it shows: ends are not
 * exact. */
GstClockTime
OutputSchedule::slack (const FrameSet &set) const
{
  return std::min (tolerance (), (set.end - set.begin) / 4);
}

GstClockTime
OutputSchedule::drain_limit () const
{
  return count_ > 0 ? end () + tolerance () - slack (at (count_ - 1)) : 0;
}

/* The first picture that may show that frame set. */
GstClockTime
OutputSchedule::first_showing (const FrameSet &set) const
{
  const GstClockTime earliest = set.begin - std::min (set.begin, tolerance ());
  const guint64 second = guint64 (rate_d_) * GST_SECOND;
  const guint64 number = gst_util_uint64_scale_ceil (earliest, guint64 (rate_n_), second);
  return gst_util_uint64_scale (number, second, guint64 (rate_n_));
}

/* The first picture after a stream position. One less than a nanosecond before a picture is that
 * picture's own, rounded. */
GstClockTime
OutputSchedule::first_after (GstClockTime pts) const
{
  const guint64 second = guint64 (rate_d_) * GST_SECOND;
  const guint64 number = gst_util_uint64_scale (pts + 1, guint64 (rate_n_), second) + 1;
  return gst_util_uint64_scale (number, second, guint64 (rate_n_));
}

/* The next picture, and which frame set it shows. */
bool
OutputSchedule::find (GstClockTime &pts, std::size_t &index) const
{
  if (!active () || count_ == 0)
    return false;
  pts = first_showing (at (0));
  for (GstClockTime before : {last_, unscheduled_})
    if (GST_CLOCK_TIME_IS_VALID (before))
      pts = std::max (pts, first_after (before));
  const GstClockTime hold = live_ ? hold_ : std::min (hold_, kMaxDuration);
  for (index = 0; index < count_; index++) {
    const bool newest = index + 1 == count_;
    if (!newest && pts + tolerance () >= at (index + 1).begin)
      continue;
    const GstClockTime limit = later_by (at (index).end, hold);
    if (pts < G_MAXINT64 && pts + slack (at (index)) < limit)
      return true;
    if (!newest)
      pts = std::max (pts, first_showing (at (index + 1)));
  }
  return false;
}

GstClockTime
OutputSchedule::next_pts () const
{
  GstClockTime pts;
  std::size_t index;
  return find (pts, index) ? pts : GST_CLOCK_TIME_NONE;
}

bool
OutputSchedule::next (GstClockTime limit, Picture &picture)
{
  GstClockTime pts;
  std::size_t index;
  if (!find (pts, index) || pts + tolerance () >= limit)
    return false;
  for (; index > 0; index--)
    remove (0);
  const bool follows = GST_CLOCK_TIME_IS_VALID (last_) && pts <= last_ + period () + 1;
  picture = {at (0).buffer, pts, period (), !follows};
  last_ = pts;
  covered_ = pts + period ();
  return true;
}
