/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "conflict.hpp"

#include <algorithm>
#include <set>
#include <vector>

namespace {

/* In the order that users think of them. "format" goes with the media type: GRAY8 of video/x-raw
 * and rggb of video/x-bayer are one choice. */
constexpr const char *kFields[] = {"format", "width", "height", "framerate"};

/* Caps reduced to the media type and one field. Transfer full. */
GstCaps *
only (GstCaps *caps, const char *field)
{
  GstCaps *result = gst_caps_new_empty ();
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    const GstStructure *from = gst_caps_get_structure (caps, i);
    GstStructure *one = gst_structure_new_empty (gst_structure_get_name (from));
    if (const GValue *value = gst_structure_get_value (from, field))
      gst_structure_set_value (one, field, value);
    gst_caps_append_structure (result, one);
  }
  return result;
}

bool
intersect (GstCaps *a, GstCaps *b, const char *field)
{
  GstCaps *of_a = only (a, field), *of_b = only (b, field);
  const bool can = gst_caps_can_intersect (of_a, of_b);
  gst_caps_unref (of_a);
  gst_caps_unref (of_b);
  return can;
}

/* As "640", or "RGB or GRAY8"; each value once, at most six. */
std::string
values_of (GstCaps *caps, const char *field)
{
  std::set<std::string> seen;
  std::string text;
  const bool format = g_str_equal (field, "format");
  for (guint i = 0; i < gst_caps_get_size (caps) && seen.size () < 6; i++) {
    const GstStructure *structure = gst_caps_get_structure (caps, i);
    const GValue *value = gst_structure_get_value (structure, field);
    gchar *serialized = value ? gst_value_serialize (value) : nullptr;
    std::string word = serialized ? serialized : format ? "any format" : "any";
    g_free (serialized);
    if (format)
      word = std::string (gst_structure_get_name (structure)) + " " + word;
    if (seen.insert (word).second)
      text += (text.empty () ? "" : " or ") + word;
  }
  return text.empty () ? "nothing" : text;
}

std::string
conflict_of (GstCaps *asked, GstCaps *there, const std::string &pad, const std::string &whose)
{
  for (const char *field : kFields)
    if (!intersect (asked, there, field))
      return "pad " + pad + ": downstream asks for " + field + " " + values_of (asked, field) +
             "; " + whose + " " + values_of (there, field);
  gchar *text = gst_caps_to_string (asked);
  std::string all = "pad " + pad + ": downstream asks for " + text +
                    ", a combination that no common format of the cameras has";
  g_free (text);
  return all;
}

} // namespace

std::string
caps_conflict (GstCaps *offered, std::span<GstPad *const> pads)
{
  GstCaps *left = gst_caps_ref (offered);
  std::string text, before;
  for (GstPad *pad : pads) {
    GstCaps *asked = gst_pad_peer_query_caps (pad, nullptr);
    GstCaps *both = gst_caps_intersect (left, asked);
    if (gst_caps_is_empty (both) && text.empty ()) {
      const bool cameras = !gst_caps_can_intersect (offered, asked);
      text = conflict_of (asked, cameras ? offered : left, GST_PAD_NAME (pad),
          cameras ? "the cameras have" : "with pad " + before + " there is");
    }
    before += (before.empty () ? "" : " and ") + std::string (GST_PAD_NAME (pad));
    gst_caps_unref (asked);
    gst_caps_unref (left);
    left = both;
  }
  gst_caps_unref (left);
  return text.empty () ? "downstream accepts none of the cameras' formats" : text;
}
