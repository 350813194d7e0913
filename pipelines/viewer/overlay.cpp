/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "overlay.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace {

constexpr gint64 kHintTime = 5 * G_USEC_PER_SEC, kHintFade = G_USEC_PER_SEC;
constexpr gint64 kMessageTime = 3 * G_USEC_PER_SEC / 2;
constexpr gint64 kBarTime = 2 * G_USEC_PER_SEC;

} // namespace

std::string
time_text (GstClockTime time)
{
  const auto seconds = static_cast<unsigned long long> (time / GST_SECOND);
  char text[48];
  if (seconds < 3600)
    std::snprintf (text, sizeof text, "%llu:%02llu", seconds / 60, seconds % 60);
  else
    std::snprintf (
        text, sizeof text, "%llu:%02llu:%02llu", seconds / 3600, seconds / 60 % 60, seconds % 60);
  return text;
}

Overlay::Overlay (std::vector<TextRow> keys, std::string hint)
    : keys_ (std::move (keys)), hint_ (std::move (hint))
{
}

Overlay::~Overlay ()
{
  if (composition_)
    gst_video_overlay_composition_unref (composition_);
}

void
Overlay::toggle_help ()
{
  std::lock_guard guard (lock_);
  help_ = !help_;
  hint_until_ = 0;
}

void
Overlay::show_bar ()
{
  std::lock_guard guard (lock_);
  bar_until_ = g_get_monotonic_time () + kBarTime;
}

void
Overlay::say (std::string message)
{
  std::lock_guard guard (lock_);
  message_ = std::move (message);
  message_until_ = g_get_monotonic_time () + kMessageTime;
}

void
Overlay::set_duration (GstClockTime duration)
{
  std::lock_guard guard (lock_);
  duration_ = duration;
}

/* ---- the mouse ---- */

bool
Overlay::is_on_bar (double y) const
{
  const int top = TimeBarPlace (shown_.size).top; /* negative: there is no room for it */
  return duration_ > 0 && shown_.size.height > 0 && top >= 0 && y >= top;
}

namespace {

/* The bit of a button in pressed_; 0: of those that the bar never takes. */
unsigned
button_bit (int button)
{
  return button >= 1 && button <= 3 ? 1U << button : 0; /* others are the wheel's */
}

} // namespace

bool
Overlay::is_dragging () const
{
  return (pressed_ & button_bit (1)) != 0;
}

void
Overlay::set_drag (double x)
{
  const TimeBarPlace place (shown_.size);
  const double share = std::clamp ((x - place.begin) / (place.end - place.begin), 0.0, 1.0);
  dragged_to_ = GstClockTime (share * double (duration_));
  drag_ = Drag{dragged_to_, false};
}

bool
Overlay::press (int button, double x, double y)
{
  std::lock_guard guard (lock_);
  const unsigned bit = button_bit (button);
  pressed_ &= ~bit; /* a release may have been lost */
  if (bit == 0 || !is_on_bar (y))
    return false;
  bar_until_ = g_get_monotonic_time () + kBarTime;
  pressed_ |= bit;
  if (button == 1)
    set_drag (x);
  return true;
}

bool
Overlay::move (double x, double)
{
  std::lock_guard guard (lock_);
  bar_until_ = g_get_monotonic_time () + kBarTime;
  if (is_dragging ())
    set_drag (x);
  return is_dragging ();
}

bool
Overlay::release (int button)
{
  std::lock_guard guard (lock_);
  const unsigned bit = button_bit (button);
  if (!(pressed_ & bit))
    return false;
  pressed_ &= ~bit;
  if (button != 1)
    return true;
  position_ = dragged_to_; /* until the picture from there comes */
  drag_ = Drag{dragged_to_, true};
  return true;
}

std::optional<Overlay::Drag>
Overlay::next_drag ()
{
  std::lock_guard guard (lock_);
  return std::exchange (drag_, std::nullopt);
}

/* ---- the picture ---- */

Overlay::Shown
Overlay::look (gint64 now) const
{
  Shown shown;
  shown.size = shown_.size;
  shown.help = help_;
  if (now < message_until_)
    shown.message = message_;
  shown.hint_tenths = int (std::clamp<gint64> (10 * (hint_until_ - now) / kHintFade, 0, 10));
  shown.bar = duration_ > 0 && (is_dragging () || now < bar_until_);
  if (shown.bar) {
    const GstClockTime at = std::min (is_dragging () ? dragged_to_ : position_, duration_);
    shown.bar_pixel = int (double (at) / double (duration_) * shown.size.width);
    shown.times = time_text (at) + " / " + time_text (duration_);
  }
  return shown;
}

namespace {

void
add (GstVideoOverlayComposition *&composition, GstVideoOverlayRectangle *rectangle)
{
  if (!rectangle)
    return;
  if (composition)
    gst_video_overlay_composition_add_rectangle (composition, rectangle);
  else
    composition = gst_video_overlay_composition_new (rectangle);
  gst_video_overlay_rectangle_unref (rectangle);
}

/* A seek to between two frame sets shows the one before, whose time is outside of the segment. */
GstClockTime
stream_time (GstSample *sample)
{
  const GstSegment *segment = gst_sample_get_segment (sample);
  const GstClockTime pts = GST_BUFFER_PTS (gst_sample_get_buffer (sample));
  if (segment->format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID (pts))
    return GST_CLOCK_TIME_NONE;
  return gst_segment_to_stream_time (segment, GST_FORMAT_TIME, std::max (pts, segment->start));
}

} // namespace

GstVideoOverlayComposition *
Overlay::draw (GstSample *sample)
{
  GstVideoInfo info;
  if (!gst_video_info_from_caps (&info, gst_sample_get_caps (sample)))
    return nullptr;
  const GstClockTime position = stream_time (sample);
  const gint64 now = g_get_monotonic_time ();
  std::lock_guard guard (lock_);
  if (GST_CLOCK_TIME_IS_VALID (position))
    position_ = position;
  if (!std::exchange (drawn_, true))
    hint_until_ = now + kHintTime;
  const PictureSize size{info.width, info.height};
  Shown shown = look (now);
  shown.size = size;
  if (shown != shown_) {
    if (composition_)
      gst_video_overlay_composition_unref (std::exchange (composition_, nullptr));
    if (shown.bar)
      add (composition_, paint_time_bar (double (shown.bar_pixel) / size.width, shown.times, size));
    if (shown.hint_tenths > 0) {
      const TextRow row{"", hint_};
      add (
          composition_, paint_text ({&row, 1}, TextPlace::kBottom, shown.hint_tenths / 10.0, size));
    }
    if (shown.help)
      add (composition_, paint_text (keys_, TextPlace::kMiddle, 1, size));
    if (!shown.message.empty ()) {
      const TextRow row{"", shown.message};
      add (composition_, paint_text ({&row, 1}, TextPlace::kTop, 1, size));
    }
    shown_ = std::move (shown);
  }
  return composition_ ? gst_video_overlay_composition_ref (composition_) : nullptr;
}

bool
Overlay::is_stale ()
{
  std::lock_guard guard (lock_);
  return drawn_ && look (g_get_monotonic_time ()) != shown_;
}
