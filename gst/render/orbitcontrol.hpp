/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/navigation.h>

#include <array>
#include <rangecast/surface/orbit.hpp>

/** The orbit camera, moved by mouse, touch and keys (GstNavigation) and by time. Has no lock:
 *  callers share it between threads under theirs. */
class OrbitControl {
public:
  rangecast::Orbit orbit;  ///< as the properties; azimuth -360 to 360
  double auto_orbit = 0;   ///< degrees a second
  guint home_requests = 0; ///< how often the first view was requested

  /** @param running_ns   time since the first picture
   *  @return the orbit at that time */
  [[nodiscard]] rangecast::Orbit at (guint64 running_ns) const;

  /** Sets what is on the screen, for drags, and the camera's position while properties are 0. */
  void set_shown (const rangecast::OrbitMatrices &matrices, const rangecast::SceneFrame &scene,
      int width, int height);

  /** @return whether the event was handled */
  bool handle (GstEvent *event);

  /** Resets buttons and fingers that are down. */
  void release ()
  {
    button_ = 0;
    fingers_ = {};
  }

private:
  bool press (GstEvent *event);
  bool drag (GstEvent *event);
  bool scroll (GstEvent *event);
  bool key (const char *name);
  bool touch_down (GstEvent *event);
  bool touch_up (GstEvent *event);
  bool touch_move (GstEvent *event);
  void orbit_by (double dx, double dy);
  void pan_by (double dx, double dy);
  void turn (double azimuth_deg, double elevation_deg);
  void zoom (double factor);

  struct Finger {
    bool down = false;
    guint identifier = 0;
    double x = 0, y = 0; /* pixels */
  };

  int button_ = 0;                /* that is down; 0: none */
  double x_ = 0, y_ = 0;          /* last position of the mouse, pixels */
  std::array<Finger, 2> fingers_; /* more are ignored */
  double home_distance_m_ = 1, home_elevation_deg_ = 0;
  rangecast::Vec3 pan_right_, pan_down_;
  int width_ = 640, height_ = 480;
};
