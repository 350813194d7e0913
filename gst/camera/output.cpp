/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "output.hpp"

#include <algorithm>
#include <gstrange/gstrange.h>

#include "camera/aravis/debug.hpp"
#include "clock.hpp"
#include "common/clockwait.hpp"

void
SetOutput::set_format (const SourceFormat &format)
{
  rate_ = {format.fps_n, format.fps_d};
  period_ = format.period ();
  for (const auto &pad : pads_)
    pad->set_caps (group_id_, format.caps);
}

bool
SetOutput::send (ImageSet &set)
{
  const GstClockTime base = gst_element_get_base_time (element_), capture = capture_time (set);
  GstClockTime pts = capture - base;
  if (capture < base || pts < gap_until_) {
    GST_DEBUG_OBJECT (element_, "set of %" GST_TIME_FORMAT " dropped: %s", GST_TIME_ARGS (capture),
        capture < base ? "captured before running time 0" : "a GAP event covered its time");
    return true;
  }
  if (GST_CLOCK_TIME_IS_VALID (last_pts_) && pts <= last_pts_ &&
      !GST_CLOCK_TIME_IS_VALID (set.trigger_time))
    pts = last_pts_ + 1;
  GST_LOG_OBJECT (
      element_, "set %" G_GUINT64_FORMAT " at %" GST_TIME_FORMAT, sent_, GST_TIME_ARGS (pts));
  for (std::size_t i = 0; i < pads_.size (); i++) {
    GstBuffer *buffer = set.images[i].release ();
    GST_BUFFER_PTS (buffer) = pts;
    GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_NONE;
    GST_BUFFER_DURATION (buffer) = period_;
    GST_BUFFER_OFFSET (buffer) = sent_;
    GST_BUFFER_OFFSET_END (buffer) = sent_ + 1;
    gst_range_buffer_set_capture_time (buffer, capture);
    pads_[i]->send (group_id_, buffer);
  }
  sent_++;
  last_pts_ = pts;
  last_sent_ns_ = monotonic_ns ();
  covered_until_ = pts + period_;
  return settings_.num_buffers < 0 || sent_ < static_cast<guint64> (settings_.num_buffers);
}

/* On the pipeline clock. Cameras that another element triggers are triggered on ticks, too. */
GstClockTime
SetOutput::capture_time (const ImageSet &set) const
{
  if (GST_CLOCK_TIME_IS_VALID (set.trigger_time))
    return set.trigger_time;
  GstClock *clock = clock_of_element (element_);
  const std::int64_t age_ns = monotonic_ns () - set.taken_ns;
  const auto now_ns = static_cast<std::int64_t> (gst_clock_get_time (clock));
  gst_object_unref (clock);
  std::int64_t time_ns = std::max<std::int64_t> (now_ns - age_ns, 0);
  if (settings_.trigger == TriggerMode::kAction)
    time_ns = rate_.time_of (
        rate_.at_or_after (std::max<std::int64_t> (time_ns - rate_.period_ns () / 2, 0)));
  return static_cast<GstClockTime> (time_ns);
}

void
SetOutput::send_gaps (GstClockTime until_ago)
{
  GstClock *clock = gst_element_get_clock (element_);
  if (!clock)
    return;
  const GstClockTime now = gst_clock_get_time (clock), base = gst_element_get_base_time (element_);
  gst_object_unref (clock);
  if (now < base + until_ago)
    return;
  const GstClockTime end = now - base - until_ago;
  if (end <= covered_until_)
    return;
  GST_LOG_OBJECT (element_, "gap from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
      GST_TIME_ARGS (covered_until_), GST_TIME_ARGS (end));
  for (const auto &pad : pads_)
    pad->send_gap (group_id_, covered_until_, end - covered_until_);
  covered_until_ = gap_until_ = end;
}

void
SetOutput::send_eos (guint32 seqnum) const
{
  for (const auto &pad : pads_)
    pad->send_eos (group_id_, seqnum);
}
