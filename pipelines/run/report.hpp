/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "measure.hpp"

/* What rangecast-run writes. Each write_...() says what went wrong, if anything did, and gives
 * false then. */

/** Prints a line: frames, rate, points, latency. */
void print_progress (RunMeasure &measure);
/** Writes what was measured, JSON; `rangecast demo` reads it. */
bool write_report (RunMeasure &measure, const char *path);
/** Writes the last frame of the sink named "snapshot" as a PNG. */
bool write_snapshot (GstElement *pipeline, const char *path);
