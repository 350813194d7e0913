/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

#include <gstrange/gstrangecaps.h>

/** For the first buffer of a stream. Posts an error that names the media type if a source such as
 *  filesrc, without a parser, has sent no caps. @return whether the pad has caps */
inline bool
require_caps (GstElement *element, GstPad *sink)
{
  if (gst_pad_has_current_caps (sink))
    return true;
  GstCaps *expected = gst_pad_get_pad_template_caps (sink);
  const gchar *media_type = gst_structure_get_name (gst_caps_get_structure (expected, 0));
  const bool coded = g_str_equal (media_type, GST_NEIGHBOUR_CODE_MEDIA_TYPE);
  GST_ELEMENT_ERROR (element, CORE, NEGOTIATION,
      ("pad %s: data without caps; expected %s (from a file of coded frame sets: "
       "neighbourcodeparse%s)",
          GST_PAD_NAME (sink), media_type, coded ? "" : " ! neighbourcodedec"),
      (nullptr));
  gst_caps_unref (expected);
  return false;
}

/** GstBaseTransform's default submit_input_buffer(), after require_caps(). */
inline GstFlowReturn
submit_with_caps (GstBaseTransform *base, gboolean is_discont, GstBuffer *buffer)
{
  if (!require_caps (GST_ELEMENT (base), base->sinkpad)) {
    gst_buffer_unref (buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  auto klass = static_cast<GstBaseTransformClass *> (g_type_class_peek (GST_TYPE_BASE_TRANSFORM));
  return klass->submit_input_buffer (base, is_discont, buffer);
}
