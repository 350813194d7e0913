/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <string>

/** Finds the first element downstream of a source pad that takes none of the media types that reach
 *  it, by the caps of pads and their templates.
 *  @return one sentence that names it and what makes them; empty if there is none, or the pad is
 *  flushing */
std::string explain_downstream (GstPad *src);

/** Posts explain_downstream() as an error. @return whether it was empty */
bool require_downstream (GstElement *element, GstPad *src);

/** GstAggregator's default negotiate(), after require_downstream(). */
gboolean negotiate_downstream (GstAggregator *aggregator);
