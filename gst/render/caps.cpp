/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "caps.hpp"

#include <gst/video/video.h>

namespace {

/* The frame rate that all structures of caps have, else nullptr. */
const GValue *
frame_rate (const GstCaps *caps)
{
  const GValue *rate = nullptr;
  for (guint i = 0; caps && i < gst_caps_get_size (caps); i++) {
    const GValue *own = gst_structure_get_value (gst_caps_get_structure (caps, i), "framerate");
    if (!own || (rate && gst_value_compare (rate, own) != GST_VALUE_EQUAL))
      return nullptr;
    rate = own;
  }
  return rate;
}

GstCaps *
filtered (GstCaps *caps, GstCaps *filter)
{
  if (!filter)
    return caps;
  GstCaps *result = gst_caps_intersect_full (filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (caps);
  return result;
}

} // namespace

/* One structure; fixation prefers the input's rate. Two structures that differ only in their rates
 * would be merged by elements downstream that simplify caps, into caps that are no longer a subset
 * of ours (GStreamer 1.22). */
GstCaps *
strip_output_caps (GstCaps *output_template, GstCaps *filter)
{
  GstCaps *output = gst_caps_copy (output_template);
  gst_caps_set_simple (
      output, "framerate", GST_TYPE_FRACTION_RANGE, 0, 1, kMaxFrameRate, 1, nullptr);
  return filtered (output, filter);
}

GstCaps *
strip_input_caps (const GstCaps *output, GstCaps *input_template, GstCaps *filter)
{
  GstCaps *input = gst_caps_copy (input_template);
  if (const GValue *rate = frame_rate (output)) {
    GstCaps *same = gst_caps_copy (input);
    gst_caps_set_value (same, "framerate", rate);
    input = gst_caps_merge (same, input);
  }
  return filtered (input, filter);
}

namespace {

/* The input's, or near it; 30 if the input has none and downstream requires one. */
void
fixate_rate (GstStructure *s, const GstCaps *input)
{
  int n = 0, d = 1;
  gst_structure_get_fraction (gst_caps_get_structure (input, 0), "framerate", &n, &d);
  GValue none = G_VALUE_INIT;
  g_value_init (&none, GST_TYPE_FRACTION);
  gst_value_set_fraction (&none, 0, 1);
  const GValue *wanted = gst_structure_get_value (s, "framerate");
  if (n == 0 && wanted && !gst_value_intersect (nullptr, wanted, &none))
    n = 30;
  g_value_unset (&none);
  gst_structure_fixate_field_nearest_fraction (s, "framerate", n, d);
}

/* Width and height for both eyes together. */
void
fixate_size (GstStructure *s)
{
  const gchar *mode = gst_structure_get_string (s, "multiview-mode");
  guint flags = 0, mask = 0;
  gst_structure_get_flagset (s, "multiview-flags", &flags, &mask);
  const bool half = (flags & mask & GST_VIDEO_MULTIVIEW_FLAGS_HALF_ASPECT) != 0;
  const bool wide = !half && g_strcmp0 (mode, "side-by-side") == 0;
  const bool high = !half && g_strcmp0 (mode, "top-bottom") == 0;
  gst_structure_fixate_field_nearest_int (s, "width", wide ? 1280 : 640);
  gst_structure_fixate_field_nearest_int (s, "height", high ? 960 : 480);
}

} // namespace

GstCaps *
strip_fixate_output (GstCaps *caps, const GstCaps *input)
{
  caps = gst_caps_make_writable (gst_caps_truncate (caps));
  GstStructure *s = gst_caps_get_structure (caps, 0);
  fixate_rate (s, input);
  gst_structure_fixate_field_string (s, "multiview-mode", "mono");
  if (g_strcmp0 (gst_structure_get_string (s, "multiview-mode"), "separated") == 0)
    gst_structure_set (s, "views", G_TYPE_INT, 2, nullptr);
  fixate_size (s);
  if (gst_structure_has_field (s, "pixel-aspect-ratio"))
    gst_structure_fixate_field_nearest_fraction (s, "pixel-aspect-ratio", 1, 1);
  else
    gst_structure_set (s, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  return gst_caps_fixate (caps);
}

bool
strip_has_flags_as_text (const GstCaps *output)
{
  const GstStructure *s = gst_caps_get_structure (output, 0);
  return gst_structure_has_field_typed (s, "multiview-flags", G_TYPE_STRING);
}
