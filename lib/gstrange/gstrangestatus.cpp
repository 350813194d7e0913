/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangestatus.hpp"

using rangecast::Status;
using rangecast::StatusCode;

namespace {

struct ErrorDomain {
  GQuark domain;
  gint code;
};

ErrorDomain
domain_of (StatusCode code)
{
  switch (code) {
    case StatusCode::kNotFound:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_FOUND};
    case StatusCode::kNoSpace:
      return {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT};
    case StatusCode::kBadValue:
    case StatusCode::kBadSize:
      return {GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_SETTINGS};
    case StatusCode::kUnsupported:
      return {GST_STREAM_ERROR, GST_STREAM_ERROR_WRONG_TYPE};
    case StatusCode::kInternal:
      return {GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_FAILED};
    default:
      return {GST_STREAM_ERROR, GST_STREAM_ERROR_DECODE};
  }
}

void
post (GstElement *element, const Status &status, GstMessageType type,
    const std::source_location &caller)
{
  const GstDebugLevel level = type == GST_MESSAGE_ERROR ? GST_LEVEL_ERROR : GST_LEVEL_WARNING;
  if (level <= _gst_debug_min)
    gst_debug_log (gst_range_debug_category (element), level, caller.file_name (),
        caller.function_name (), gint (caller.line ()), G_OBJECT (element), "%s",
        status.message ().c_str ());
  const ErrorDomain error = domain_of (status.code ());
  gst_element_message_full (element, type, error.domain, error.code,
      g_strdup (status.message ().c_str ()), nullptr, caller.file_name (), caller.function_name (),
      gint (caller.line ()));
}

} // namespace

GstDebugCategory *
gst_range_debug_category (GstElement *element)
{
  GstElementFactory *factory = gst_element_get_factory (element);
  GstDebugCategory *category = nullptr;
  if (factory)
    GST_DEBUG_CATEGORY_GET (category, GST_OBJECT_NAME (factory));
  return category ? category : GST_CAT_DEFAULT;
}

GstFlowReturn
gst_range_flow_return (GstElement *element, const Status &status, std::source_location caller)
{
  if (status.ok ())
    return GST_FLOW_OK;
  post (element, status, GST_MESSAGE_ERROR, caller);
  return GST_FLOW_ERROR;
}

void
gst_range_post_warning (GstElement *element, const Status &status, std::source_location caller)
{
  if (!status.ok ())
    post (element, status, GST_MESSAGE_WARNING, caller);
}
