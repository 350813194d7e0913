/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/roi/segmentation.hpp>
#include <string>

#include "common/properties.hpp"

/** roiextract's properties. Guarded by the element's lock. */
struct RoiSettings {
  int background_frames = 30; ///< frames of the empty scene to learn the background from
  int settle_frames = 0;      ///< frames to skip before learning
  std::string background_file, save_background; ///< empty: none
  rangecast::SegmentationSettings segmentation;
  int margin = 0;           ///< around the foreground, pixels
  int n_threads = 0;        ///< 0 = one per core
  double adapt_time_s = 30; ///< seconds; 0 = never
};

PropertyTable<RoiSettings> &roi_properties ();
