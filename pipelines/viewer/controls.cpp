/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Keys, and the mouse on the time bar. Events come in the window's thread. */
#include <gst/video/navigation.h>
#include <gstrange/gstrange.h>

#include <algorithm>
#include <cstdio>
#include <string_view>

#include "viewer.hpp"

namespace {

constexpr GstClockTime kSkip = 5 * GST_SECOND;

/* ---- views ---- */

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

/* Switches the rig's view of that number on or off; 0: all on. @return what to say of it */
std::string
switch_view (Viewer &viewer, guint number)
{
  guint64 mask = G_MAXUINT64, all = 0;
  if (number == 0) {
    g_object_set (viewer.render, "view-mask", mask, nullptr);
    return "all views shown";
  }
  const std::vector<guint> ids = view_ids (viewer); /* none before the first frame set */
  if (number > ids.size ())
    return "no view " + std::to_string (number);
  for (guint id : ids)
    all |= guint64 (1) << id;
  g_object_get (viewer.render, "view-mask", &mask, nullptr);
  mask ^= guint64 (1) << ids[number - 1];
  g_object_set (viewer.render, "view-mask", mask, nullptr);
  if ((mask & all) == 0)
    return "all views hidden; 0 shows them";
  const guint id = ids[number - 1];
  return "view " + std::to_string (number) +
         (id == number - 1 ? "" : " (view-id " + std::to_string (id) + ")") +
         (mask >> id & 1 ? " on" : " off");
}

/* ---- keys ---- */

GstClockTime
frame_duration (Viewer &viewer)
{
  GstSample *sample = last_frame_set (viewer);
  gint n = 0, d = 1;
  if (sample) {
    gst_structure_get_fraction (
        gst_caps_get_structure (gst_sample_get_caps (sample), 0), "framerate", &n, &d);
    gst_sample_unref (sample);
  }
  return n > 0 ? gst_util_uint64_scale_int (GST_SECOND, d, n) : GST_CLOCK_TIME_NONE;
}

void
skip (Viewer &viewer, bool forward)
{
  const GstClockTime at = viewer.playback->position ();
  const GstClockTime to = forward ? at + kSkip : at - std::min (at, kSkip);
  viewer.playback->seek (to, true);
  viewer.overlay->show_bar ();
}

void
step (Viewer &viewer, bool forward)
{
  viewer.playback->step (forward, frame_duration (viewer));
  viewer.overlay->show_bar ();
}

void
pause (Viewer &viewer)
{
  viewer.playback->toggle_pause ();
  viewer.overlay->show_bar ();
}

template <guint number>
void
view_key (Viewer &viewer)
{
  viewer.overlay->say (switch_view (viewer, number));
}

using KeyAction = void (*) (Viewer &viewer);

struct Key {
  const char *name; /* of X11 */
  bool of_file;     /* of streams, striprender has it */
  KeyAction act;
};
const Key kKeys[] = {
    {"h", false, [] (Viewer &v) { v.overlay->toggle_help (); }},
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
    {"0", false, view_key<0>},
    {"1", false, view_key<1>},
    {"2", false, view_key<2>},
    {"3", false, view_key<3>},
    {"4", false, view_key<4>},
    {"5", false, view_key<5>},
    {"6", false, view_key<6>},
    {"7", false, view_key<7>},
    {"8", false, view_key<8>},
    {"9", false, view_key<9>},
};

} // namespace

std::vector<TextRow>
key_rows (bool is_file)
{
  std::vector<TextRow> rows = {{"drag", "orbit; with another button: pan"}};
  rows.push_back ({"wheel, + -", "zoom"});
  rows.push_back (
      is_file ? TextRow{"up, down", "look from above or below"} : TextRow{"arrows", "turn"});
  rows.push_back ({"r, Home", "back to the opening view"});
  rows.push_back ({"1 to 9, 0", "hide or show a camera's view; show all"});
  if (is_file) {
    rows.push_back ({"space", "pause or play"});
    rows.push_back ({"left, right", "5 seconds back or forward"});
    rows.push_back ({", .", "one frame back or forward"});
  }
  rows.push_back ({"s", "save the picture (PNG)"});
  rows.push_back ({"p", "save the points (PLY)"});
  rows.push_back ({"m", "sound off or on"});
  rows.push_back ({"h", "show or hide these keys"});
  rows.push_back ({"q, Esc", "quit"});
  return rows;
}

namespace {

struct KeyPress {
  Viewer *viewer;
  KeyAction act;
};

gboolean
act_on_key (gpointer user_data)
{
  auto press = static_cast<KeyPress *> (user_data);
  Viewer &viewer = *press->viewer;
  press->act (viewer);
  viewer.playback->redraw_if_paused ();
  return G_SOURCE_REMOVE;
}

/* @return whether the key is ours */
bool
handle_key (Viewer &viewer, GstEvent *event, bool pressed)
{
  const gchar *name = nullptr;
  if (!gst_navigation_event_parse_key_event (event, &name) || !name)
    return false;
  const auto key = std::ranges::find_if (kKeys, [&] (const Key &k) {
    return (viewer.is_file || !k.of_file) && std::string_view (k.name) == name;
  });
  if (key == std::end (kKeys))
    return false;
  if (pressed)
    g_idle_add_full (G_PRIORITY_DEFAULT, act_on_key, new KeyPress{&viewer, key->act},
        [] (gpointer press) { delete static_cast<KeyPress *> (press); });
  return true;
}

/* ---- the time bar ---- */

gboolean
act_on_mouse (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (const auto drag = viewer.overlay->next_drag ())
    viewer.playback->seek (drag->position, drag->released);
  else if (viewer.overlay->is_stale ())
    viewer.playback->redraw_if_paused ();
  return G_SOURCE_REMOVE;
}

/* @return whether the time bar has the event */
bool
handle_mouse (Viewer &viewer, GstEvent *event)
{
  gint button = 0;
  gdouble x = 0, y = 0;
  bool taken = false;
  switch (gst_navigation_event_get_type (event)) {
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS:
      gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
      taken = viewer.overlay->press (button, x, y);
      break;
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE:
      gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
      taken = viewer.overlay->release (button);
      break;
    case GST_NAVIGATION_EVENT_MOUSE_MOVE:
      gst_navigation_event_parse_mouse_move_event (event, &x, &y);
      taken = viewer.overlay->move (x, y);
      break;
    default:
      return false;
  }
  g_idle_add (act_on_mouse, &viewer);
  return taken;
}

/* @return whether the event is for the viewer */
bool
handle_event (Viewer &viewer, GstEvent *event)
{
  const GstNavigationEventType type = gst_navigation_event_get_type (event);
  if (type == GST_NAVIGATION_EVENT_KEY_PRESS || type == GST_NAVIGATION_EVENT_KEY_RELEASE)
    return handle_key (viewer, event, type == GST_NAVIGATION_EVENT_KEY_PRESS);
  return handle_mouse (viewer, event);
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
  const bool taken = handle_event (viewer, event);
  if (!taken &&
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
