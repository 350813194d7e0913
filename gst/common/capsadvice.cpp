/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "capsadvice.hpp"

#include <gstrange/gstrangecaps.h>
#include <string>

/* "video/x-raw, image/jpeg" */
static std::string
media_types (const GstCaps *caps)
{
  std::string types;
  for (guint i = 0; i < gst_caps_get_size (caps); i++)
    if (const std::string type = gst_structure_get_name (gst_caps_get_structure (caps, i));
        types.find (type) == std::string::npos)
      types += (types.empty () ? "" : ", ") + type;
  return types;
}

bool
require_downstream (GstElement *element, GstPad *src, bool strict)
{
  GstPad *peer = GST_PAD_IS_FLUSHING (src) ? nullptr : gst_pad_get_peer (src);
  if (!peer)
    return true;
  GstCaps *own = gst_pad_get_pad_template_caps (src), *taken = gst_pad_query_caps (peer, nullptr);
  const std::string output = media_types (own), accepted = media_types (taken);
  bool fits = gst_caps_is_any (taken) || (!strict && gst_caps_is_empty (taken));
  for (guint i = 0; i < gst_caps_get_size (own); i++)
    fits |= accepted.find (gst_structure_get_name (gst_caps_get_structure (own, i))) !=
            std::string::npos;
  gst_caps_unref (own);
  gst_caps_unref (taken);
  GstObject *parent = gst_pad_get_parent (peer);
  const std::string next = GST_OBJECT_NAME (parent ? parent : GST_OBJECT (peer));
  gst_clear_object (&parent);
  gst_object_unref (peer);
  if (fits)
    return true;
  std::string text = GST_OBJECT_NAME (element) + (" outputs " + output) + ", but " + next;
  text += accepted.empty () ? " and what it is linked to have no format in common"
                            : " accepts only " + accepted;
  if (accepted.find ("video/x-raw") != std::string::npos)
    text += output.find (GST_RANGE_MEDIA_TYPE) != std::string::npos
                ? "; add striprender before " + next
                : "; add neighbourcodedec ! striprender before " + next;
  GST_ELEMENT_ERROR (element, CORE, NEGOTIATION, ("%s", text.c_str ()), (nullptr));
  return false;
}

gboolean
negotiate_downstream (GstAggregator *aggregator)
{
  auto klass = static_cast<GstAggregatorClass *> (g_type_class_peek (GST_TYPE_AGGREGATOR));
  return require_downstream (GST_ELEMENT (aggregator), GST_AGGREGATOR_SRC_PAD (aggregator)) &&
         klass->negotiate (aggregator);
}
