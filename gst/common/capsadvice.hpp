/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

/** Posts an error that says what to add, if the peer of a source pad accepts none of the media
 * types that the pad outputs. @return whether it accepts one, or the pad is flushing or unlinked */
bool require_downstream (GstElement *element, GstPad *src);

/** GstAggregator's default negotiate(), after require_downstream(). */
gboolean negotiate_downstream (GstAggregator *aggregator);
