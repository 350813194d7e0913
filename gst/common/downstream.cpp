/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "downstream.hpp"

#include <algorithm>
#include <gstrange/gstrangecaps.h>
#include <string_view>
#include <vector>

namespace {

constexpr int kMaxHops = 64;
constexpr std::size_t kMaxTypes = 3; /* in a sentence */

using Types = std::vector<std::string_view>;

Types
media_types (const GstCaps *caps)
{
  Types types;
  for (guint i = 0; i < gst_caps_get_size (caps); i++)
    if (const char *type = gst_structure_get_name (gst_caps_get_structure (caps, i));
        std::ranges::find (types, type) == types.end ())
      types.emplace_back (type);
  return types;
}

std::string
join (const Types &types)
{
  std::string text;
  for (std::size_t i = 0; i < std::min (types.size (), kMaxTypes); i++)
    text += (i > 0 ? ", " : "") + std::string (types[i]);
  return types.size () > kMaxTypes ? text + " ..." : text;
}

const char *
how_to_draw (std::string_view made, const Types &taken)
{
  if (std::ranges::find (taken, "video/x-raw") == taken.end ())
    return "";
  return made == GST_RANGE_MEDIA_TYPE            ? "; striprender draws it"
         : made == GST_NEIGHBOUR_CODE_MEDIA_TYPE ? "; neighbourcodedec ! striprender draw it"
                                                 : "";
}

std::string
name_of_parent (GstPad *pad)
{
  GstObject *parent = gst_pad_get_parent (pad);
  const std::string name = parent ? GST_OBJECT_NAME (parent) : GST_OBJECT_NAME (pad);
  gst_clear_object (&parent);
  return name;
}

/* @return transfer full; nullptr if the pad's element does not have just one source pad */
GstPad *
next_source_pad (GstPad *sink)
{
  GstElement *element = gst_pad_get_parent_element (sink);
  if (!element)
    return nullptr;
  GST_OBJECT_LOCK (element);
  auto next = element->numsrcpads == 1
                  ? static_cast<GstPad *> (gst_object_ref (element->srcpads->data))
                  : nullptr;
  GST_OBJECT_UNLOCK (element);
  gst_object_unref (element);
  return next;
}

/* @param[out] next  transfer full: the pad to go on with, where the peer takes nothing because of
 *                   what comes after it */
std::string
explain_link (GstPad *src, GstPad *sink, GstPad *&next)
{
  GstCaps *made = gst_pad_get_pad_template_caps (src), *taken = gst_pad_query_caps (sink, nullptr);
  std::string text;
  if (gst_caps_is_empty (taken)) {
    next = next_source_pad (sink);
  } else if (!gst_caps_can_intersect (made, taken)) {
    const Types from = media_types (made), to = media_types (taken);
    text = name_of_parent (src) + " makes " + join (from) + ", and " + name_of_parent (sink) +
           " takes " + join (to) + how_to_draw (from.front (), to);
  }
  gst_caps_unref (made);
  gst_caps_unref (taken);
  return text;
}

} // namespace

std::string
explain_downstream (GstPad *src)
{
  std::string text;
  auto pad = static_cast<GstPad *> (gst_object_ref (src));
  for (int i = 0; pad && i < kMaxHops && text.empty (); i++) {
    GstPad *peer = gst_pad_get_peer (pad), *next = nullptr;
    if (peer && !GST_PAD_IS_FLUSHING (pad))
      text = explain_link (pad, peer, next);
    gst_clear_object (&peer);
    gst_object_unref (pad);
    pad = next;
  }
  gst_clear_object (&pad);
  return text;
}

bool
require_downstream (GstElement *element, GstPad *src)
{
  const std::string text = explain_downstream (src);
  if (!text.empty ())
    GST_ELEMENT_ERROR (element, CORE, NEGOTIATION, ("%s", text.c_str ()), (nullptr));
  return text.empty ();
}

gboolean
negotiate_downstream (GstAggregator *aggregator)
{
  auto klass = static_cast<GstAggregatorClass *> (g_type_class_peek (GST_TYPE_AGGREGATOR));
  return require_downstream (GST_ELEMENT (aggregator), GST_AGGREGATOR_SRC_PAD (aggregator)) &&
         klass->negotiate (aggregator);
}
