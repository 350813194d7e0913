/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "concealment.hpp"

using rangecast::RangeImage;
using rangecast::Status;

namespace {

/* Pixels are not repeated across a longer jump in time, nor views for longer. */
constexpr GstClockTime kMaxAge = GST_SECOND;

bool
is_soon_after (GstClockTime now, GstClockTime then)
{
  return GST_CLOCK_TIME_IS_VALID (now) && GST_CLOCK_TIME_IS_VALID (then) && now >= then &&
         now - then <= kMaxAge;
}

} // namespace

/* DISCONT comes with every lost packet, when the last pixels are needed most; they are too old only
 * where the time jumps. */
GstBuffer *
Concealment::begin (GstBuffer *input)
{
  now_ = GST_BUFFER_PTS (input);
  if (last_ && GST_BUFFER_IS_DISCONT (input) && !is_soon_after (now_, GST_BUFFER_PTS (last_)))
    reset ();
  return last_;
}

Status
Concealment::add_views (const rangecast::AccessUnitDecoder &decoder,
    std::span<const RangeImage> older, GstBuffer *buffer)
{
  std::uint64_t there = 0;
  for (const auto &view : decoder.views ()) {
    if (Status s = gstrange::add_view (buffer, view.view_id, view.roi, view.capture_time_ns);
        !s.ok ())
      return s;
    there |= std::uint64_t{1} << view.view_id;
    last_seen_[std::size_t (view.view_id)] = now_;
  }
  for (const RangeImage &image : older)
    if (!(there >> image.view_id & 1) &&
        is_soon_after (now_, last_seen_[std::size_t (image.view_id)]))
      if (Status s = gstrange::add_view (buffer, image.view_id, image.roi, image.capture_time_ns);
          !s.ok ())
        return s;
  return {};
}
