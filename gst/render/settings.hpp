/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/surface/painting.hpp>

#include "common/properties.hpp"
#include "orbitcontrol.hpp"

enum class RenderBackendChoice { kAuto, kSoftware, kOpenGl };

/** striprender's properties. Any thread, under the element's lock. */
struct StripRenderSettings {
  OrbitControl camera;
  guint background = 0xff000000 | rangecast::kBackgroundColour; ///< ARGB
  double background_shade = 0;                                  ///< share, of opaque backgrounds
  double point_size = 1;                                        ///< in footprints of a pixel
  bool fit = false;                                             ///< to the content
  guint64 view_mask = G_MAXUINT64;                              ///< bit n: view-id n is drawn
  double blend_range_m = rangecast::kBlendRange_m;
  bool tint_views = false;
  double eye_distance_m = 0.063; ///< most people's
  double convergence_m = 0;      ///< 0: the camera target's distance
  bool keep_rate = false;        ///< even if it is the input's
  RenderBackendChoice backend = RenderBackendChoice::kAuto;
  rangecast::StripSettings strips;
};

PropertyTable<StripRenderSettings> &strip_properties ();
