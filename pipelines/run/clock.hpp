/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Makes the pipeline use a clock instead of what its elements provide.
 *  @param name  "system" (monotonic), or HOST:PORT, where rangemux clock-port publishes one; waits
 *  until that is known
 *  @return false after reporting what is wrong with the name */
bool use_clock (GstElement *pipeline, const char *name);
