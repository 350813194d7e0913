/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/neighbourcode/encoder.hpp>

#include "bitrate.hpp"
#include "common/properties.hpp"

/** Settings of neighbourcodeenc. Any thread, under the element's lock. */
struct NeighbourCodeEncSettings {
  rangecast::EncoderSettings coding; ///< frame_interval_ns is set for each frame set
  NeighbourCodeRateSettings rate;
  int n_threads = 0;         ///< 0: one per core
  guint key_interval_ms = 0; ///< maximum time between key frame sets; 0: none
};

PropertyTable<NeighbourCodeEncSettings> &encoder_properties ();
