/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/base/status.hpp>
#include <source_location>

#include "gstrange-prelude.h"

/** Posts an element's error message for a status, logs it in the element's debug category, and
 *  returns the flow return: GST_FLOW_OK for kOk, else GST_FLOW_ERROR. Call without locks held.
 *  kNotFound becomes RESOURCE/NOT_FOUND, kBadValue and kBadSize LIBRARY/SETTINGS, kNoSpace
 *  RESOURCE/NO_SPACE_LEFT, kUnsupported STREAM/WRONG_TYPE, kInternal LIBRARY/FAILED, all others
 *  STREAM/DECODE.
 *  @param caller  source location for the message */
GstFlowReturn gst_range_flow_return (GstElement *element, const rangecast::Status &status,
    std::source_location caller = std::source_location::current ());

/** Posts and logs a warning for a status that is not kOk. Call without locks held. */
void gst_range_post_warning (GstElement *element, const rangecast::Status &status,
    std::source_location caller = std::source_location::current ());

/** The debug category with the name of the element's factory, for code that several elements share;
 *  GStreamer's default category if there is none. */
GstDebugCategory *gst_range_debug_category (GstElement *element);
