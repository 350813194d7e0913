/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangeinfo.hpp"

#include <algorithm>

using rangecast::Rig;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

namespace gstrange {

static Status
parse_rig (const GstStructure *structure, Rig &rig)
{
  const GValue *value = gst_structure_get_value (structure, "rig");
  if (!value || !GST_VALUE_HOLDS_BUFFER (value) || !gst_value_get_buffer (value))
    return {StatusCode::kNotFound, "caps: no field \"rig\" (buffer) with the rig's binary form"};
  GstBuffer *buffer = gst_value_get_buffer (value);
  GstMapInfo map;
  if (!gst_buffer_map (buffer, &map, GST_MAP_READ))
    return {StatusCode::kBadData, "caps: the buffer in field \"rig\" cannot be read"};
  Status status = rangecast::decode_rig ({map.data, map.size}, rig);
  gst_buffer_unmap (buffer, &map);
  if (!status.ok ())
    return {status.code (), "caps: field \"rig\": " + status.message ()};
  return {};
}

Status
parse_caps (const GstCaps *caps, RangeInfo &info)
{
  if (!caps || !gst_caps_is_fixed (caps))
    return {StatusCode::kBadValue, "caps: not fixed"};
  const GstStructure *structure = gst_caps_get_structure (caps, 0);
  RangeInfo parsed;
  int views = 0;
  if (!gst_structure_get_int (structure, "width", &parsed.width) ||
      !gst_structure_get_int (structure, "height", &parsed.height) || parsed.width < 1 ||
      parsed.height < 1)
    return {StatusCode::kNotFound, "caps: no fields \"width\" and \"height\" in pixels"};
  if (!gst_structure_get_int (structure, "views", &views))
    return {StatusCode::kNotFound, "caps: no field \"views\""};
  gst_structure_get_fraction (structure, "framerate", &parsed.fps_n, &parsed.fps_d);
  if (Status s = parse_rig (structure, parsed.rig); !s.ok ())
    return s;
  if (parsed.views () != views)
    return {StatusCode::kBadValue, "caps: views=" + std::to_string (views) + " but the rig has " +
                                       std::to_string (parsed.views ())};
  if (parsed.width > rangecast::kMaxRigPixels / parsed.height / std::max (views, 1))
    return {StatusCode::kBadSize, "caps: views x width x height is beyond the limit of " +
                                      std::to_string (rangecast::kMaxRigPixels) + " pixels"};
  for (const View &view : parsed.rig.views) {
    const std::string name = "caps: rig: view " + std::to_string (view.id);
    if (!view.is_range_view ())
      return {StatusCode::kBadValue, name + " has distortion or partner cameras; rectify it"};
    if (view.width > parsed.width || view.height > parsed.height)
      return {StatusCode::kBadValue, name + " is larger than the caps' width and height"};
  }
  info = std::move (parsed);
  return {};
}

GstClockTime
RangeInfo::frame_duration () const
{
  if (fps_n <= 0 || fps_d <= 0)
    return GST_CLOCK_TIME_NONE;
  return gst_util_uint64_scale_int (GST_SECOND, fps_d, fps_n);
}

RangeInfo
make_info (Rig rig, int fps_n, int fps_d)
{
  RangeInfo info;
  for (const View &view : rig.views) {
    info.width = std::max (info.width, view.width);
    info.height = std::max (info.height, view.height);
  }
  info.fps_n = fps_n;
  info.fps_d = fps_d;
  info.rig = std::move (rig);
  return info;
}

static void
set_rig (GstCaps *caps, const rangecast::Rig &rig)
{
  const std::vector<std::uint8_t> blob = rangecast::encode_rig (rig);
  GstBuffer *buffer = gst_buffer_new_memdup (blob.data (), blob.size ());
  gst_caps_set_simple (caps, "rig", GST_TYPE_BUFFER, buffer, nullptr);
  gst_buffer_unref (buffer);
}

void
set_view (GstCaps *caps, const View &view)
{
  set_rig (caps, {{view}});
}

Status
parse_view (const GstCaps *caps, View &view)
{
  Rig rig;
  if (Status s = parse_rig (gst_caps_get_structure (caps, 0), rig); !s.ok ())
    return s;
  if (rig.views.size () != 1 || !rig.views[0].is_range_view ())
    return {StatusCode::kBadValue, "caps: field \"rig\" is not one rectified view"};
  view = rig.views[0];
  return {};
}

static GstCaps *
with_common_fields (GstCaps *caps, const RangeInfo &info)
{
  gst_caps_set_simple (caps, "width", G_TYPE_INT, info.width, "height", G_TYPE_INT, info.height,
      "framerate", GST_TYPE_FRACTION, info.fps_n, info.fps_d, "views", G_TYPE_INT, info.views (),
      nullptr);
  set_rig (caps, info.rig);
  return caps;
}

GstCaps *
with_rig (const GstCaps *caps, const rangecast::Rig &rig)
{
  GstCaps *copy = gst_caps_copy (caps);
  set_rig (copy, rig);
  return copy;
}

GstCaps *
make_range_caps (const RangeInfo &info)
{
  return with_common_fields (
      gst_caps_new_simple (GST_RANGE_MEDIA_TYPE, "format", G_TYPE_STRING, "Z16_RGBx", nullptr),
      info);
}

GstCaps *
make_neighbour_code_caps (const RangeInfo &info)
{
  return with_common_fields (gst_caps_new_simple (GST_NEIGHBOUR_CODE_MEDIA_TYPE, "version",
                                 G_TYPE_INT, 4, "alignment", G_TYPE_STRING, "access-unit", nullptr),
      info);
}

GstCaps *
recode_caps (const GstCaps *caps, bool coded, GstCaps *filter)
{
  static GstStaticCaps media[] = {
      GST_STATIC_CAPS (GST_RANGE_MEDIA_TYPE ", format = (string) Z16_RGBx"),
      GST_STATIC_CAPS (
          GST_NEIGHBOUR_CODE_MEDIA_TYPE ", version = (int) 4, alignment = (string) access-unit")};
  GstCaps *form = gst_static_caps_get (&media[coded]);
  GstCaps *other = gst_caps_new_empty ();
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    GstStructure *common = gst_structure_copy (gst_caps_get_structure (caps, i));
    gst_structure_remove_fields (common, "format", "version", "alignment", nullptr);
    GstStructure *merged = gst_structure_copy (gst_caps_get_structure (form, 0));
    gst_structure_foreach (
        common,
        [] (GQuark field, const GValue *value, gpointer to) -> gboolean {
          gst_structure_id_set_value (static_cast<GstStructure *> (to), field, value);
          return TRUE;
        },
        merged);
    gst_structure_free (common);
    gst_caps_append_structure (other, merged);
  }
  gst_caps_unref (form);
  if (!filter)
    return other;
  GstCaps *filtered = gst_caps_intersect_full (filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (other);
  return filtered;
}

} // namespace gstrange
