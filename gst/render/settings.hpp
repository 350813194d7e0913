/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/surface/strips.hpp>

#include "orbitcontrol.hpp"

/** What an application wants of striprender. Any thread, under the element's lock. */
struct StripRenderSettings {
  static constexpr guint kDefaultBackground = 0xff20242a;

  OrbitControl camera;
  guint background = kDefaultBackground; ///< ARGB
  double background_shade = 0;           ///< share, of opaque backgrounds
  double point_size = 1;                 ///< footprints of a pixel
  bool fit = false;                      ///< to what is drawn
  guint64 view_mask = G_MAXUINT64;       ///< bit n: view-id n is drawn
  bool show_cameras = false;
  bool back_faces = false;
  double view_gap_m = 0.012;
  double blend_range_m = 0.02;
  int samples = 0; ///< a pixel; below 2: no antialiasing
  bool show_units = false;
  bool show_stats = false;
  double eye_distance_m = 0.063;                ///< that of most people
  double convergence_m = 0;                     ///< 0: the target's distance
  bool keep_rate = false;                       ///< the output's, even if it is the input's
  GstClockTime hold_time = GST_CLOCK_TIME_NONE; ///< of a frame set that none follows
  rangecast::StripSettings strips;
  guint strips_serial = 0; ///< another one after each change but the camera's
};

/** Installs the properties of these settings, numbers 1 to the result. All may change in any state
 *  and are controllable. */
guint install_strip_settings (GObjectClass *object_class);

/** @return false if no property of these settings has that number */
bool set_strip_setting (StripRenderSettings &settings, guint id, const GValue *value);
bool get_strip_setting (const StripRenderSettings &settings, guint id, GValue *value);

/** Tells listeners which numbers differ. Call it without a lock. */
void notify_strip_settings (
    GObject *object, const StripRenderSettings &before, const StripRenderSettings &after);

GType gst_strip_render_mode_get_type (void);
#define GST_TYPE_STRIP_RENDER_MODE (gst_strip_render_mode_get_type ())
