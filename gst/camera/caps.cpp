/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "caps.hpp"

#include <algorithm>
#include <numeric>

namespace {

constexpr int kWidthStep = 4;

/* ---- what the cameras provide ---- */

std::vector<std::string>
common_formats (std::span<const CameraAbilities> cameras)
{
  std::vector<std::string> common = cameras[0].pixel_formats;
  for (const CameraAbilities &camera : cameras.subspan (1))
    std::erase_if (common, [&] (const std::string &name) {
      return std::ranges::find (camera.pixel_formats, name) == camera.pixel_formats.end ();
    });
  return common;
}

struct SizeRange {
  int min, max, step;
};

/* Sizes of a camera are its minimum plus multiples of its step; these are multiples of the step,
 * which in practice is the same. */
SizeRange
common_range (std::span<const CameraAbilities> cameras, bool widths)
{
  SizeRange range{1, G_MAXINT, widths ? kWidthStep : 1};
  for (const CameraAbilities &c : cameras) {
    range.min = std::max (range.min, widths ? c.min_width : c.min_height);
    range.max = std::min (range.max, widths ? c.max_width : c.max_height);
    range.step = std::lcm (range.step, std::max (1, widths ? c.width_step : c.height_step));
  }
  range.min = (range.min + range.step - 1) / range.step * range.step;
  range.max = range.max / range.step * range.step;
  return range;
}

void
set_range (GstStructure *structure, const char *field, const SizeRange &range)
{
  GValue value = G_VALUE_INIT;
  if (range.min == range.max) {
    gst_structure_set (structure, field, G_TYPE_INT, range.min, nullptr);
    return;
  }
  g_value_init (&value, GST_TYPE_INT_RANGE);
  gst_value_set_int_range_step (&value, range.min, range.max, range.step);
  gst_structure_take_value (structure, field, &value);
}

std::string
formats_of (const CameraAbilities &camera)
{
  std::string text;
  for (const std::string &name : camera.pixel_formats)
    text += (text.empty () ? "" : ", ") + name;
  for (const std::string &name : camera.other_formats)
    text += (text.empty () ? "" : ", ") + name + " (not carried)";
  return text.empty () ? "none" : text;
}

std::string
list_of (std::span<const CameraAbilities> cameras, std::span<const std::string> labels)
{
  std::string text;
  for (std::size_t i = 0; i < cameras.size (); i++)
    text += (text.empty () ? "" : "; ") + labels[i] + ": " + formats_of (cameras[i]);
  return text;
}

} // namespace

GstCaps *
camera_source_caps (std::span<const CameraAbilities> cameras, std::span<const std::string> labels,
    const std::string &pixel_format, std::string &why)
{
  const SizeRange widths = common_range (cameras, true), heights = common_range (cameras, false);
  GstCaps *caps = gst_caps_new_empty ();
  if (widths.min > widths.max || heights.min > heights.max) {
    why = "the cameras have no image size in common";
    return caps;
  }
  for (const std::string &name : common_formats (cameras))
    if (pixel_format.empty () || pixel_format == name)
      gst_caps_append (caps, camera_caps (name));
  if (gst_caps_is_empty (caps))
    why = "the cameras have no pixel format in common that is " +
          (pixel_format.empty () ? "carried" : pixel_format) +
          "; they have: " + list_of (cameras, labels);
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    GstStructure *structure = gst_caps_get_structure (caps, i);
    set_range (structure, "width", widths);
    set_range (structure, "height", heights);
    gst_structure_set (structure, "framerate", GST_TYPE_FRACTION_RANGE, 1, 1000, 1000, 1, nullptr);
  }
  return caps;
}

/* ---- what the peers accept ---- */

namespace {

std::string
conflict (GstPad *pad, GstCaps *left)
{
  GstCaps *asked = gst_pad_peer_query_caps (pad, nullptr);
  GstCaps *simple = gst_caps_simplify (gst_caps_copy (left));
  gchar *asked_text = gst_caps_to_string (asked), *left_text = gst_caps_to_string (simple);
  std::string text = std::string ("pad ") + GST_PAD_NAME (pad) + ": downstream accepts " +
                     asked_text + "; the cameras and the pads before it leave " + left_text;
  g_free (asked_text);
  g_free (left_text);
  gst_caps_unref (asked);
  gst_caps_unref (simple);
  return text;
}

} // namespace

void
choose_camera_format (GstCaps *offered, std::span<GstPad *const> pads,
    std::span<const CameraAbilities> cameras, SourceFormat &format, std::string &why)
{
  GstCaps *caps = gst_caps_ref (offered);
  for (GstPad *pad : pads) {
    GstCaps *peer = gst_pad_peer_query_caps (pad, caps);
    GstCaps *both = gst_caps_intersect_full (peer, caps, GST_CAPS_INTERSECT_FIRST);
    gst_caps_unref (peer);
    if (gst_caps_is_empty (both)) {
      why = conflict (pad, caps);
      gst_caps_unref (both);
      gst_caps_unref (caps);
      return;
    }
    gst_caps_unref (caps);
    caps = both;
  }
  caps = gst_caps_make_writable (gst_caps_truncate (caps));
  GstStructure *structure = gst_caps_get_structure (caps, 0);
  gst_structure_fixate_field_nearest_int (structure, "width", G_MAXINT);
  gst_structure_fixate_field_nearest_int (structure, "height", G_MAXINT);
  double max_rate = 30;
  for (const CameraAbilities &camera : cameras)
    if (camera.max_frame_rate > 0)
      max_rate = std::min (max_rate, camera.max_frame_rate);
  gint n = 30, d = 1;
  if (max_rate < 30)
    gst_util_double_to_fraction (max_rate, &n, &d);
  gst_structure_fixate_field_nearest_fraction (structure, "framerate", n, d);
  caps = gst_caps_fixate (caps);
  structure = gst_caps_get_structure (caps, 0);
  gst_structure_get_int (structure, "width", &format.width);
  gst_structure_get_int (structure, "height", &format.height);
  gst_structure_get_fraction (structure, "framerate", &format.fps_n, &format.fps_d);
  format.pixel_format = pixel_format_for_caps (caps, cameras[0].pixel_formats);
  gst_caps_take (&format.caps, caps);
}
