/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "orbitcontrol.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

using rangecast::Orbit;

namespace {

constexpr double kZoomStep = 1.1;
constexpr double kKeyTurn_deg = 5;
constexpr double kMaxElevation_deg = 89; /* as the property */
constexpr double kMaxDistance_m = 1000;  /* as the properties */

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

void
OrbitControl::set_shown (const rangecast::OrbitMatrices &matrices,
    const rangecast::SceneFrame &scene, int width, int height)
{
  home_distance_m_ = scene.distance_m;
  home_elevation_deg_ = scene.elevation_deg;
  pan_right_ = matrices.pan_right;
  pan_down_ = matrices.pan_down;
  width_ = width;
  height_ = height;
}

/* Stays within the ranges of the properties and below the vertical, which is nearer where the first
 * view itself looks down or up. */
void
OrbitControl::turn (double azimuth_deg, double elevation_deg)
{
  orbit.azimuth_deg = std::fmod (orbit.azimuth_deg + azimuth_deg, 360.0);
  orbit.elevation_deg = std::clamp (orbit.elevation_deg + elevation_deg,
      std::max (-kMaxElevation_deg, -kMaxElevation_deg - home_elevation_deg_),
      std::min (kMaxElevation_deg, kMaxElevation_deg - home_elevation_deg_));
}

void
OrbitControl::zoom (double factor)
{
  const double distance_m = orbit.distance_m > 0 ? orbit.distance_m : home_distance_m_;
  orbit.distance_m = std::clamp (distance_m * factor, 0.01, kMaxDistance_m);
}

bool
OrbitControl::press (GstEvent *event)
{
  double x = 0, y = 0;
  gint button = 0;
  gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
  if (button == 4 || button == 5) { /* the wheel, from older sinks */
    zoom (button == 4 ? 1 / kZoomStep : kZoomStep);
    return true;
  }
  if (!is_on_screen (x, y))
    return false;
  button_ = button;
  x_ = x;
  y_ = y;
  return true;
}

/* Half a circle over the width of the picture, a quarter over its height. */
void
OrbitControl::orbit_by (double dx, double dy)
{
  turn (-180 * dx / width_, 90 * dy / height_);
}

/* The scene follows the pointer. */
void
OrbitControl::pan_by (double dx, double dy)
{
  const rangecast::Vec3 pan = orbit.pan - dx / width_ * pan_right_ - dy / height_ * pan_down_;
  const auto limited = [] (double metres) {
    return std::clamp (metres, -kMaxDistance_m, kMaxDistance_m);
  };
  orbit.pan = {limited (pan.x), limited (pan.y), limited (pan.z)};
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
      pan_by (dx / 2, dy / 2);
      if (before > 1 && after > 1)
        zoom (before / after);
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
    zoom (delta_y > 0 ? 1 / kZoomStep : kZoomStep);
  return true;
}

/* Names are X11's keysyms; some windows send them without Shift, where + is equal. */
bool
OrbitControl::key (const char *name)
{
  const std::string_view k = name;
  if (k == "r" || k == "Home") {
    orbit = {.fov_deg = orbit.fov_deg, .pan = {}}; /* no event changes the field of view */
    home_requests++;
  } else if (k == "Left" || k == "Right")
    turn (k == "Left" ? -kKeyTurn_deg : kKeyTurn_deg, 0);
  else if (k == "Up" || k == "Down")
    turn (0, k == "Up" ? kKeyTurn_deg : -kKeyTurn_deg);
  else if (k == "plus" || k == "equal" || k == "KP_Add")
    zoom (1 / kZoomStep);
  else if (k == "minus" || k == "KP_Subtract")
    zoom (kZoomStep);
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
