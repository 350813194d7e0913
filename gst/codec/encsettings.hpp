/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/neighbourcode/encoder.hpp>

#include "bitrate.hpp"
#include "common/properties.hpp"

/** What an application wants of neighbourcodeenc. Any thread, under the element's lock. */
struct NeighbourCodeEncSettings {
  rangecast::EncoderSettings coding; ///< frame_interval_ns: of the frame set at hand
  NeighbourCodeRateSettings rate;
  int n_threads = 0;                        ///< 0: one a core
  guint key_interval_ms = 0;                ///< at most between two key frame sets; 0: no limit
  GstClockTime min_forced_key_interval = 0; ///< at least before one on request
};

/** Their properties. */
PropertyTable<NeighbourCodeEncSettings> &encoder_properties ();
