/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "orbitcontrol.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

using rangecast::Orbit;

static constexpr double kZoomStep = 1.1;
static constexpr double kKeyTurnDeg = 5;

Orbit
OrbitControl::at (guint64 running_ns) const
{
  Orbit turned = orbit;
  turned.azimuth_deg += std::fmod (auto_orbit * double (running_ns) / GST_SECOND, 360.0);
  return turned;
}

void
OrbitControl::shown (const rangecast::OrbitMatrices &matrices, int width, int height)
{
  distance_m_ = matrices.distance_m;
  pan_right_ = matrices.pan_right;
  pan_down_ = matrices.pan_down;
  width_ = width;
  height_ = height;
}

/* Keeps within what the properties allow: all round, but not over the top. */
void
OrbitControl::turn (double azimuth_deg, double elevation_deg)
{
  orbit.azimuth_deg = std::fmod (orbit.azimuth_deg + azimuth_deg, 360.0);
  orbit.elevation_deg = std::clamp (orbit.elevation_deg + elevation_deg, -89.0, 89.0);
}

void
OrbitControl::zoom (double factor)
{
  orbit.distance_m = std::clamp (distance_m_ * factor, 0.01, 1000.0);
  distance_m_ = orbit.distance_m; /* further steps may come before the next picture */
}

bool
OrbitControl::press (GstEvent *event)
{
  double x = 0, y = 0;
  gint button = 0;
  gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
  if (button == 4 || button == 5) { /* the wheel, of older sinks */
    zoom (button == 4 ? 1 / kZoomStep : kZoomStep);
    return true;
  }
  button_ = button;
  x_ = x;
  y_ = y;
  return true;
}

/* Turns half a circle over the width of the picture; moves as far as the hand does. */
bool
OrbitControl::drag (GstEvent *event)
{
  if (button_ == 0)
    return false;
  double x = 0, y = 0;
  gst_navigation_event_parse_mouse_move_event (event, &x, &y);
  const double dx = (x - x_) / width_, dy = (y - y_) / height_;
  x_ = x;
  y_ = y;
  if (button_ == 1)
    turn (-180 * dx, 90 * dy);
  else
    orbit.pan = orbit.pan - dx * pan_right_ - dy * pan_down_;
  return true;
}

bool
OrbitControl::scroll (GstEvent *event)
{
  double x = 0, y = 0, delta_x = 0, delta_y = 0;
  gst_navigation_event_parse_mouse_scroll_event (event, &x, &y, &delta_x, &delta_y);
  if (delta_y != 0)
    zoom (delta_y > 0 ? 1 / kZoomStep : kZoomStep);
  return true;
}

bool
OrbitControl::key (const char *name)
{
  const std::string_view k = name;
  if (k == "r")
    orbit = {};
  else if (k == "Left" || k == "Right")
    turn (k == "Left" ? -kKeyTurnDeg : kKeyTurnDeg, 0);
  else if (k == "Up" || k == "Down")
    turn (0, k == "Up" ? kKeyTurnDeg : -kKeyTurnDeg);
  else if (k == "plus" || k == "minus")
    zoom (k == "plus" ? 1 / kZoomStep : kZoomStep);
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
      release ();
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_MOVE:
      return drag (event);
    case GST_NAVIGATION_EVENT_MOUSE_SCROLL:
      return scroll (event);
    case GST_NAVIGATION_EVENT_KEY_PRESS:
      return gst_navigation_event_parse_key_event (event, &name) && name && key (name);
    default:
      return false;
  }
}
