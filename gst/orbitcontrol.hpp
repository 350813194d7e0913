/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/navigation.h>

#include <rangecast/strips/orbit.hpp>

/** The orbit camera as mouse and keys (GstNavigation) and time move it. Holds no lock: whoever
 *  shares it between threads does. */
class OrbitControl {
public:
  rangecast::Orbit orbit; ///< as properties show it; azimuth within 360 degrees either way
  double auto_orbit = 0;  ///< degrees a second

  /** @param running_ns   time since the first picture
   *  @return the orbit at that time */
  [[nodiscard]] rangecast::Orbit at (guint64 running_ns) const;

  /** Tells what is on the screen, which is what a hand drags. */
  void shown (const rangecast::OrbitMatrices &matrices, int width, int height);

  /** @return whether the event meant something to us */
  bool handle (GstEvent *event);

  /** Forgets a button that is down. */
  void release () { button_ = 0; }

private:
  bool press (GstEvent *event);
  bool drag (GstEvent *event);
  bool scroll (GstEvent *event);
  bool key (const char *name);
  void turn (double azimuth_deg, double elevation_deg);
  void zoom (double factor);

  int button_ = 0;       /* that is down; 0: none */
  double x_ = 0, y_ = 0; /* where the mouse was, pixels */
  double distance_m_ = 1;
  rangecast::Vec3 pan_right_, pan_down_;
  int width_ = 640, height_ = 480;
};
