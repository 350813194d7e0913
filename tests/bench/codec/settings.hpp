/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "codec.hpp"

namespace bench {

/** RVL + JPEG at all qualities, which ratios need, and all other peers that are there.
 *  @param sequence  there are several frame sets, so that video codecs make sense
 *  @return names of peers that this build lacks */
std::vector<std::string> add_peers (const rangecast::Rig &rig, bool sequence, Codecs &codecs);

/** The neighbour code: every profile at several thresholds and choices.
 *  @param sequence  there are several frame sets, so that temporal ones make sense */
rangecast::Status add_profiles (const rangecast::Rig &rig, bool sequence, Codecs &codecs);

} // namespace bench
