/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Keys. Events come in the window's thread. */
#include <gst/video/navigation.h>
#include <gstrange/gstrange.h>

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <vector>

#include "viewer.hpp"

const char kKeyHelp[] = R"(Keys:
  drag            orbit; with another button: pan
  wheel, + -      zoom
  arrows          turn; in a file, up and down only
  r, Home         back to the opening view
  1 to 9, 0       hide or show a camera's view; show all
  space           pause or play a file
  left, right     5 seconds back or forward in a file
  , .             one frame back or forward in a file
  s               save the frame (PNG)
  p               save the points (PLY)
  m               sound off or on
  h               print these keys
  q, Esc          quit
)";

namespace {

/* ---- keys, main thread ---- */

void
say (const std::string &text)
{
  std::printf ("%s\n", text.c_str ());
  std::fflush (stdout);
}

/* The view-ids of the rig, in their order. */
std::vector<guint>
view_ids (Viewer &viewer)
{
  std::vector<guint> ids;
  GstSample *sample = last_frame_set (viewer);
  if (!sample)
    return ids;
  GstRangeCamera camera;
  for (guint id = 0; id < 64; id++)
    if (gst_range_caps_get_camera (gst_sample_get_caps (sample), id, &camera))
      ids.push_back (id);
  gst_sample_unref (sample);
  return ids;
}

/* Switches the rig's view of that number on or off; 0: all on. */
void
switch_view (Viewer &viewer, guint number)
{
  guint64 mask = G_MAXUINT64, all = 0;
  const std::vector<guint> ids = view_ids (viewer); /* none before the first frame set */
  if (number > ids.size ()) {
    say ("no view " + std::to_string (number));
    return;
  }
  std::string text = "all views shown";
  if (number > 0) {
    for (guint id : ids)
      all |= guint64 (1) << id;
    const guint id = ids[number - 1];
    g_object_get (viewer.render, "view-mask", &mask, nullptr);
    mask ^= guint64 (1) << id;
    text = (mask & all) == 0
               ? "all views hidden; 0 shows them"
               : "view " + std::to_string (number) +
                     (id == number - 1 ? "" : " (view-id " + std::to_string (id) + ")") +
                     (mask >> id & 1 ? " on" : " off");
  }
  g_object_set (viewer.render, "view-mask", mask, nullptr);
  say (text);
}

void
print_time (Viewer &viewer)
{
  const auto seconds = [] (GstClockTime time) { return double (time) / GST_SECOND; };
  std::printf ("%.1f of %.1f s\n", seconds (viewer.playback->position ()),
      seconds (viewer.playback->duration ()));
  std::fflush (stdout);
}

void
skip (Viewer &viewer, bool forward)
{
  constexpr GstClockTime kSkip = 5 * GST_SECOND;
  const GstClockTime at = viewer.playback->position ();
  viewer.playback->seek (forward ? at + kSkip : at - std::min (at, kSkip), true);
  print_time (viewer);
}

void
step (Viewer &viewer, bool forward)
{
  gint n = 0, d = 1;
  if (GstSample *sample = last_frame_set (viewer)) {
    gst_structure_get_fraction (
        gst_caps_get_structure (gst_sample_get_caps (sample), 0), "framerate", &n, &d);
    gst_sample_unref (sample);
  }
  viewer.playback->step (
      forward, n > 0 ? gst_util_uint64_scale_int (GST_SECOND, d, n) : GST_CLOCK_TIME_NONE);
  print_time (viewer);
}

void
pause (Viewer &viewer)
{
  viewer.playback->toggle_pause ();
  say (viewer.playback->is_paused () ? "paused" : "playing");
}

void
toggle_mute (Viewer &viewer)
{
  GstElement *volume = viewer.volume;
  if (!volume) {
    say ("no sound");
    return;
  }
  gboolean mute = FALSE;
  g_object_get (volume, "mute", &mute, nullptr);
  g_object_set (volume, "mute", !mute, nullptr);
  say (mute ? "sound on" : "sound off");
}

using KeyAction = void (*) (Viewer &viewer);

struct Key {
  std::string_view name; /* of X11 */
  bool of_file;          /* of streams, striprender has it */
  KeyAction act;
};
const Key kKeys[] = {
    {"h", false, [] (Viewer &) { say (kKeyHelp); }},
    {"s", false, write_picture},
    {"p", false, write_points},
    {"m", false, toggle_mute},
    {"q", false, [] (Viewer &v) { g_main_loop_quit (v.loop); }},
    {"Escape", false, [] (Viewer &v) { g_main_loop_quit (v.loop); }},
    {"space", true, pause},
    {"Left", true, [] (Viewer &v) { skip (v, false); }},
    {"Right", true, [] (Viewer &v) { skip (v, true); }},
    {"comma", true, [] (Viewer &v) { step (v, false); }},
    {"period", true, [] (Viewer &v) { step (v, true); }},
};

/* @return nullptr if the key is not ours; digits have no entry of their own */
const Key *
find_key (const Viewer &viewer, std::string_view name)
{
  static const Key digit = {};
  if (name.size () == 1 && name[0] >= '0' && name[0] <= '9')
    return &digit;
  const auto key = std::ranges::find_if (
      kKeys, [&] (const Key &k) { return (viewer.is_file || !k.of_file) && k.name == name; });
  return key == std::end (kKeys) ? nullptr : key;
}

void
act_on_key (Viewer &viewer, const std::string &name)
{
  if (const Key *key = find_key (viewer, name); key->act)
    key->act (viewer);
  else
    switch_view (viewer, guint (name[0] - '0'));
  viewer.playback->redraw_if_paused ();
}

/* ---- events, any thread ---- */

/* @return whether the event is for the viewer */
bool
handle_event (Viewer &viewer, GstEvent *event)
{
  const GstNavigationEventType type = gst_navigation_event_get_type (event);
  const gchar *name = nullptr;
  if ((type != GST_NAVIGATION_EVENT_KEY_PRESS && type != GST_NAVIGATION_EVENT_KEY_RELEASE) ||
      !gst_navigation_event_parse_key_event (event, &name) || !name || !find_key (viewer, name))
    return false;
  if (type == GST_NAVIGATION_EVENT_KEY_PRESS)
    in_main_loop ([&viewer, key = std::string (name)] { act_on_key (viewer, key); });
  return true;
}

GstPadProbeReturn
on_event (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
  if (GST_EVENT_TYPE (event) != GST_EVENT_NAVIGATION ||
      !handle_event (*static_cast<Viewer *> (user_data), event))
    return GST_PAD_PROBE_OK;
  gst_event_unref (event);
  return GST_PAD_PROBE_HANDLED;
}

} // namespace

void
handle_missed_event (Viewer &viewer, GstMessage *message)
{
  GstEvent *event = nullptr;
  if (gst_navigation_message_get_type (message) != GST_NAVIGATION_MESSAGE_EVENT ||
      !gst_navigation_message_parse_event (message, &event))
    return;
  if (!handle_event (viewer, event) &&
      gst_navigation_event_get_type (event) == GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE) {
    GstPad *pad = gst_element_get_static_pad (viewer.render, "src");
    gst_pad_send_event (pad, gst_event_ref (event)); /* else it would go on turning */
    gst_object_unref (pad);
  }
  gst_event_unref (event);
}

void
watch_controls (Viewer &viewer)
{
  GstPad *pad = gst_element_get_static_pad (viewer.render, "src");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, on_event, &viewer, nullptr);
  gst_object_unref (pad);
}
