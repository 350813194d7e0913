/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/navigation.h>

#include <array>
#include <rangecast/surface/orbit.hpp>

/** The orbit camera, moved by mouse, touch and keys (GstNavigation) and by time. Has no lock:
 *  callers share it between threads under theirs. */
class OrbitControl : public rangecast::OrbitMotion {
public:
  double auto_orbit = 0; ///< degrees a second

  /** @param running_ns   time since the first picture
   *  @return the orbit at that time */
  [[nodiscard]] rangecast::Orbit at (guint64 running_ns) const;

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

  struct Finger {
    bool down = false;
    guint identifier = 0;
    double x = 0, y = 0; /* pixels */
  };

  int button_ = 0;                /* that is down; 0: none */
  double x_ = 0, y_ = 0;          /* last position of the mouse, pixels */
  std::array<Finger, 2> fingers_; /* more are ignored */
};
