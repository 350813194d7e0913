/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <string>

/** Finds the first link downstream of a source pad whose elements have no media type in common.
 *  @return one sentence that names both elements; empty if there is none, or the pad is flushing */
std::string explain_downstream (GstPad *src);

/** Posts explain_downstream() as an error. @return whether it was empty */
bool require_downstream (GstElement *element, GstPad *src);

/** GstAggregator's default negotiate(), after require_downstream(). */
gboolean negotiate_downstream (GstAggregator *aggregator);
