/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "padlinkwatch.hpp"

#include <string>

namespace {

std::string
unlinked_sink_pads (GstElement *element)
{
  std::string names;
  const auto add = [] (GstElement *, GstPad *pad, gpointer to) -> gboolean {
    auto &list = *static_cast<std::string *> (to);
    if (!gst_pad_is_linked (pad) && !gst_pad_has_current_caps (pad)) /* PackedInput feeds one */
      list += std::string (list.empty () ? "" : ", ") + GST_PAD_NAME (pad);
    return TRUE;
  };
  gst_element_foreach_sink_pad (element, add, &names);
  return names;
}

gboolean
check (GstClock *, GstClockTime, GstClockID, gpointer data)
{
  auto element = static_cast<GstElement *> (data);
  const std::string names = unlinked_sink_pads (element);
  if (!names.empty ())
    GST_ELEMENT_ERROR (element, CORE, PAD, ("Sink pad not linked: %s", names.c_str ()),
        ("another pad has had caps for a second; every sink pad of this element needs a stream"));
  return TRUE;
}

} // namespace

void
PadLinkWatch::begin (GstElement *element)
{
  std::lock_guard guard (lock_);
  if (timer_)
    return;
  GstClock *clock = gst_system_clock_obtain ();
  timer_ = gst_clock_new_single_shot_id (clock, gst_clock_get_time (clock) + GST_SECOND);
  gst_clock_id_wait_async (timer_, check, gst_object_ref (element), gst_object_unref);
  gst_object_unref (clock);
}

void
PadLinkWatch::reset ()
{
  std::lock_guard guard (lock_);
  if (timer_) {
    gst_clock_id_unschedule (timer_);
    gst_clock_id_unref (timer_);
    timer_ = nullptr;
  }
}
