/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

/** Posts an error that says what to add, if the peer of a source pad accepts none of the media
 *  types that the pad outputs.
 *  @param strict  false: no error if the peer accepts nothing at all, because it will say why
 *  @return whether it accepts one, or the pad is flushing or unlinked */
bool require_downstream (GstElement *element, GstPad *src, bool strict = true);

/** GstAggregator's default negotiate(), after require_downstream(). */
gboolean negotiate_downstream (GstAggregator *aggregator);

/** update_src_caps() of aggregators that set caps with their first output. */
inline GstFlowReturn
keep_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}
