/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/navigation.h>

#include <array>
#include <rangecast/surface/orbit.hpp>

/** The orbit camera as mouse, fingers and keys (GstNavigation) and time move it. Holds no lock:
 * whoever shares it between threads does. */
class OrbitControl {
public:
  rangecast::Orbit orbit;  ///< as properties show it; azimuth within 360 degrees either way
  double auto_orbit = 0;   ///< degrees a second
  guint home_requests = 0; ///< how often somebody asked for the first view

  /** @param running_ns   time since the first picture
   *  @return the orbit at that time */
  [[nodiscard]] rangecast::Orbit at (guint64 running_ns) const;

  /** Tells what is on the screen, which is what a hand drags, and where the camera of the scene
   *  stands while properties are 0. */
  void shown (const rangecast::OrbitMatrices &matrices, const rangecast::SceneFrame &scene,
      int width, int height);

  /** @return whether the event meant something to us */
  bool handle (GstEvent *event);

  /** Forgets buttons and fingers that are down. */
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
  void turn_by_hand (double dx, double dy);
  void move_by_hand (double dx, double dy);
  void turn (double azimuth_deg, double elevation_deg);
  void zoom (double factor);
  void go_back ();

  struct Finger {
    bool down = false;
    guint identifier = 0;
    double x = 0, y = 0; /* pixels */
  };

  int button_ = 0;                /* that is down; 0: none */
  double x_ = 0, y_ = 0;          /* where the mouse was, pixels */
  std::array<Finger, 2> fingers_; /* further ones do nothing */
  double home_distance_m_ = 1, home_elevation_deg_ = 0;
  rangecast::Vec3 pan_right_, pan_down_;
  int width_ = 640, height_ = 480;
};
