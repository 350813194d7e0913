/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "playback.hpp"

#include <algorithm>

GstClockTime
Playback::duration () const
{
  gint64 duration = 0;
  const bool known = gst_element_query_duration (pipeline_, GST_FORMAT_TIME, &duration);
  return known && duration > 0 ? GstClockTime (duration) : 0;
}

GstClockTime
Playback::position () const
{
  if (next_)
    return next_->position;
  if (seeking_)
    return under_way_;
  gint64 position = 0;
  const bool known = gst_element_query_position (pipeline_, GST_FORMAT_TIME, &position);
  return known && position > 0 ? GstClockTime (position) : 0;
}

void
Playback::toggle_pause ()
{
  if (!seekable_)
    return;
  paused_ = !paused_;
  gst_element_set_state (pipeline_, paused_ ? GST_STATE_PAUSED : GST_STATE_PLAYING);
}

bool
Playback::start (const Target &target)
{
  const auto how = target.accurate ? GST_SEEK_FLAG_ACCURATE : GST_SEEK_FLAG_KEY_UNIT;
  seeking_ = gst_element_seek_simple (pipeline_, GST_FORMAT_TIME,
      GstSeekFlags (GST_SEEK_FLAG_FLUSH | how), gint64 (target.position));
  under_way_ = target.position;
  return seeking_;
}

bool
Playback::seek (GstClockTime position, bool accurate)
{
  if (!seekable_)
    return false;
  if (const GstClockTime end = duration (); end > 0)
    position = std::min (position, end - 1);
  const Target target{position, accurate};
  if (!seeking_)
    return start (target);
  next_ = target;
  return true;
}

void
Playback::step (bool forward, GstClockTime frame_duration)
{
  if (!seekable_ || !GST_CLOCK_TIME_IS_VALID (frame_duration))
    return;
  if (!paused_)
    toggle_pause ();
  const GstClockTime at = position (), end = duration ();
  if (!forward)
    seek (at > frame_duration ? at - frame_duration : 0, true);
  else if (end == 0 || at + frame_duration < end) /* the last one stays */
    seek (at + frame_duration, true);
}

void
Playback::redraw_if_paused ()
{
  if (!paused_)
    return;
  redraw_ = seeking_;
  if (!seeking_)
    seek (position (), true); /* which may be beyond the end if paused as the file starts over */
}

void
Playback::seek_done ()
{
  seeking_ = false;
  if (next_) {
    const Target target = *next_;
    next_.reset ();
    redraw_ = false;
    start (target);
  } else if (redraw_) {
    redraw_if_paused ();
  }
}
