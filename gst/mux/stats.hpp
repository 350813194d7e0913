/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What rangemux counts, as applications read it. Call with the element's lock. */

#include "common/statsreporter.hpp"
#include "streams.hpp"

/** Frame sets since start: those that went out, and of them those with a buffer of every pad. */
struct MuxCounters {
  guint64 frames = 0, complete = 0;
};

/** The property `stats`. @return transfer full */
GstStructure *make_stats (const MuxPads &pads, const MuxCounters &sent);

/** For `rangecast-stats` messages: the element's, and one a pad. A stream's frame sets that went
 *  without it count from the element's start. */
std::vector<StatsRow> rows_of (const MuxPads &pads, const MuxCounters &sent);
