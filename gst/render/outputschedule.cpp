/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "outputschedule.hpp"

#include <algorithm>

static GstClockTime
later_by (GstClockTime time, GstClockTime more)
{
  return GST_CLOCK_TIME_IS_VALID (more) && time < G_MAXINT64 && more < G_MAXINT64
             ? time + more
             : GST_CLOCK_TIME_NONE;
}

static GstClockTime
earlier_by (GstClockTime time, GstClockTime less)
{
  return time > less ? time - less : 0;
}

void
PictureGrid::set_rate (int n, int d)
{
  rate_n_ = gst_util_fraction_compare (n, std::max (d, 1), kMaxRate, 1) > 0 ? 0 : n;
  rate_d_ = std::max (d, 1);
}

GstClockTime
PictureGrid::period () const
{
  return active () ? gst_util_uint64_scale (GST_SECOND, guint64 (rate_d_), guint64 (rate_n_)) : 0;
}

void
PictureGrid::drop (std::size_t i)
{
  gst_clear_buffer (&at (i).buffer);
  for (; i > 0; i--)
    at (i) = at (i - 1);
  at (0).buffer = nullptr;
  first_ = (first_ + 1) % ring_.size ();
  count_--;
}

void
PictureGrid::drop_frame_sets ()
{
  while (count_ > 0)
    drop (0);
}

void
PictureGrid::reset ()
{
  drop_frame_sets ();
  foreign_ = GST_CLOCK_TIME_NONE;
  last_ = GST_CLOCK_TIME_NONE;
  covered_ = 0;
}

GstClockTime
PictureGrid::known_until () const
{
  return count_ > 0 ? at (count_ - 1).begin : 0;
}

GstClockTime
PictureGrid::end () const
{
  return count_ > 0 ? at (count_ - 1).end : 0;
}

/* By how much a picture is before the end of what it shows, at least: ends are not quite even. */
GstClockTime
PictureGrid::slack (const FrameSet &set) const
{
  return std::min (tolerance (), (set.end - set.begin) / 4);
}

GstClockTime
PictureGrid::until_the_end () const
{
  return count_ > 0 ? end () + tolerance () - slack (at (count_ - 1)) : 0;
}

void
PictureGrid::add (GstBuffer *frame_set, GstClockTime duration)
{
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = period ();
  GstClockTime begin = GST_BUFFER_PTS (frame_set);
  if (!GST_CLOCK_TIME_IS_VALID (begin))
    begin = end ();
  duration = std::min (duration, kLongest);
  while (later_by (begin, duration) < known_until ())
    drop (count_ - 1);
  begin = std::max (begin, known_until ());
  if (begin >= G_MAXINT64) {
    gst_buffer_unref (frame_set);
    return;
  }
  if (count_ == ring_.size ())
    drop (1); /* the first one is on the screen */
  at (count_++) = {frame_set, begin, begin + duration};
}

/* Of the pictures that may show that frame set. */
GstClockTime
PictureGrid::first_showing (const FrameSet &set) const
{
  const guint64 number = gst_util_uint64_scale_ceil (
      earlier_by (set.begin, tolerance ()), guint64 (rate_n_), guint64 (rate_d_) * GST_SECOND);
  return gst_util_uint64_scale (number, guint64 (rate_d_) * GST_SECOND, guint64 (rate_n_));
}

/* A time less than a nanosecond before a picture's is that picture's, rounded. */
GstClockTime
PictureGrid::first_after (GstClockTime pts) const
{
  const guint64 second = guint64 (rate_d_) * GST_SECOND;
  const guint64 number = gst_util_uint64_scale (pts + 1, guint64 (rate_n_), second) + 1;
  return gst_util_uint64_scale (number, second, guint64 (rate_n_));
}

bool
PictureGrid::find (GstClockTime &pts, std::size_t &index) const
{
  if (!active () || count_ == 0)
    return false;
  pts = first_showing (at (0));
  for (GstClockTime before : {last_, foreign_})
    if (GST_CLOCK_TIME_IS_VALID (before))
      pts = std::max (pts, first_after (before));
  for (index = 0; index < count_; index++) {
    const bool newest = index + 1 == count_;
    if (!newest && pts + tolerance () >= at (index + 1).begin)
      continue;
    const GstClockTime limit = later_by (at (index).end, hold ());
    if (pts < G_MAXINT64 && pts + slack (at (index)) < limit)
      return true;
    if (!newest)
      pts = std::max (pts, first_showing (at (index + 1)));
  }
  return false;
}

GstClockTime
PictureGrid::next_pts () const
{
  GstClockTime pts;
  std::size_t index;
  return find (pts, index) ? pts : GST_CLOCK_TIME_NONE;
}

bool
PictureGrid::take (GstClockTime until, Picture &picture)
{
  GstClockTime pts;
  std::size_t index;
  if (!find (pts, index) || pts + tolerance () >= until)
    return false;
  for (; index > 0; index--)
    drop (0);
  const bool follows = GST_CLOCK_TIME_IS_VALID (last_) && pts <= last_ + period () + 1;
  picture = {at (0).buffer, pts, period (), !follows};
  last_ = pts;
  covered_ = pts + period ();
  return true;
}
