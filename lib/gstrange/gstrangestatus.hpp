/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/base/status.hpp>
#include <source_location>

#include "gstrange-prelude.h"

/** Posts the one error message of an element for a core status and gives the flow return for it:
 *  GST_FLOW_OK for kOk, else GST_FLOW_ERROR. Call without any lock held.
 *  kNotFound becomes RESOURCE/NOT_FOUND, kBadValue and kBadSize become LIBRARY/SETTINGS, foreign
 *  bytes STREAM/DECODE, kNoSpace RESOURCE/NO_SPACE_LEFT, kInternal LIBRARY/FAILED.
 *  @param caller  where the message says that it comes from */
GST_RANGE_API GstFlowReturn gst_range_flow_return (GstElement *element,
    const rangecast::Status &status,
    std::source_location caller = std::source_location::current ());

/** The same as a warning; the element goes on. */
GST_RANGE_API void gst_range_post_warning (GstElement *element, const rangecast::Status &status,
    std::source_location caller = std::source_location::current ());
