/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/roi/segmentation.hpp>
#include <string>

#include "common/properties.hpp"

/** What an application wants of roiextract. Any thread, under the element's lock. */
struct RoiSettings {
  int background_frames = 30; ///< of the empty scene, from which a background is learnt
  int settle_frames = 0;      ///< at the start, from which nothing is learnt
  std::string background_file, save_background; ///< empty: none
  rangecast::SegmentationSettings segmentation;
  int margin = 0;           ///< around what is left, pixels
  int n_threads = 0;        ///< 0 = as many as there are cores
  double adapt_time_s = 30; ///< seconds; 0 = never
};

/** Their properties. */
PropertyTable<RoiSettings> &roi_properties ();

GType gst_roi_extract_cue_get_type (void);
#define GST_TYPE_ROI_EXTRACT_CUE (gst_roi_extract_cue_get_type ())
