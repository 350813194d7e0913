/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "orbitcontrol.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

using rangecast::Orbit;

namespace {

/* No screen is larger, and results for larger numbers may not be finite. */
bool
is_on_screen (double x, double y)
{
  constexpr double kMax = 1e6; /* pixels */
  return std::abs (x) <= kMax && std::abs (y) <= kMax;
}

} // namespace

Orbit
OrbitControl::at (guint64 running_ns) const
{
  Orbit turned = orbit;
  turned.azimuth_deg += std::fmod (auto_orbit * double (running_ns) / GST_SECOND, 360.0);
  return turned;
}

bool
OrbitControl::press (GstEvent *event)
{
  double x = 0, y = 0;
  gint button = 0;
  gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
  if (button == 4 || button == 5) { /* the wheel, from older sinks */
    step_nearer (button == 4);
    return true;
  }
  if (!is_on_screen (x, y))
    return false;
  button_ = button;
  x_ = x;
  y_ = y;
  return true;
}

bool
OrbitControl::drag (GstEvent *event)
{
  if (button_ == 0)
    return false;
  double x = 0, y = 0;
  gst_navigation_event_parse_mouse_move_event (event, &x, &y);
  if (!is_on_screen (x, y))
    return false;
  if (button_ == 1)
    orbit_by (x - x_, y - y_);
  else
    pan_by (x - x_, y - y_);
  x_ = x;
  y_ = y;
  return true;
}

bool
OrbitControl::touch_down (GstEvent *event)
{
  Finger finger{true, 0, 0, 0};
  gst_navigation_event_parse_touch_event (event, &finger.identifier, &finger.x, &finger.y, nullptr);
  if (!is_on_screen (finger.x, finger.y))
    return false;
  const auto free = std::ranges::find (fingers_, false, &Finger::down);
  if (free != fingers_.end ())
    *free = finger;
  return true;
}

bool
OrbitControl::touch_up (GstEvent *event)
{
  guint identifier = 0;
  gst_navigation_event_parse_touch_up_event (event, &identifier, nullptr, nullptr);
  for (Finger &finger : fingers_)
    if (finger.identifier == identifier)
      finger.down = false;
  return true;
}

/* One finger orbits; two pan with their middle and zoom with their distance. */
bool
OrbitControl::touch_move (GstEvent *event)
{
  Finger to;
  gst_navigation_event_parse_touch_event (event, &to.identifier, &to.x, &to.y, nullptr);
  if (!is_on_screen (to.x, to.y))
    return false;
  for (Finger &finger : fingers_) {
    const Finger &other = &finger == &fingers_[0] ? fingers_[1] : fingers_[0];
    if (!finger.down || finger.identifier != to.identifier)
      continue;
    const double dx = to.x - finger.x, dy = to.y - finger.y;
    if (other.down) {
      const double before = std::hypot (finger.x - other.x, finger.y - other.y);
      const double after = std::hypot (to.x - other.x, to.y - other.y);
      pinch (dx / 2, dy / 2, before, after);
    } else {
      orbit_by (dx, dy);
    }
    finger.x = to.x;
    finger.y = to.y;
  }
  return true;
}

bool
OrbitControl::scroll (GstEvent *event)
{
  double x = 0, y = 0, delta_x = 0, delta_y = 0;
  gst_navigation_event_parse_mouse_scroll_event (event, &x, &y, &delta_x, &delta_y);
  if (delta_y != 0)
    step_nearer (delta_y > 0);
  return true;
}

/* Names are X11's keysyms; some windows send them without Shift, where + is equal. */
bool
OrbitControl::key (const char *name)
{
  const std::string_view k = name;
  if (k == "r" || k == "Home")
    go_home ();
  else if (k == "Left" || k == "Right")
    step (k == "Left" ? -1 : 1, 0);
  else if (k == "Up" || k == "Down")
    step (0, k == "Up" ? 1 : -1);
  else if (k == "plus" || k == "equal" || k == "KP_Add")
    step_nearer (true);
  else if (k == "minus" || k == "KP_Subtract")
    step_nearer (false);
  else
    return false;
  return true;
}

bool
OrbitControl::handle (GstEvent *event)
{
  const gchar *name = nullptr;
  switch (gst_navigation_event_get_type (event)) {
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS:
      return press (event);
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE:
      button_ = 0;
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_MOVE:
      return drag (event);
    case GST_NAVIGATION_EVENT_MOUSE_SCROLL:
      return scroll (event);
    case GST_NAVIGATION_EVENT_KEY_PRESS:
      return gst_navigation_event_parse_key_event (event, &name) && name && key (name);
    case GST_NAVIGATION_EVENT_TOUCH_DOWN:
      return touch_down (event);
    case GST_NAVIGATION_EVENT_TOUCH_MOTION:
      return touch_move (event);
    case GST_NAVIGATION_EVENT_TOUCH_UP:
      return touch_up (event);
    case GST_NAVIGATION_EVENT_TOUCH_CANCEL:
      release ();
      return true;
    default:
      return false;
  }
}
