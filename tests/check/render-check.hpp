/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests of striprender share: a harness that downloads its pictures, and a wall to draw.
 */
#pragma once

#include "rangecast-check.hpp"

#include <gst/gl/gl.h>

#include <string>
#include <vector>

namespace rangecast::testing {

/* striprender and gldownload, 320x240 out; nullptr where there is no OpenGL. */
inline GstHarness *
render_harness (const Rig &rig, const char *properties = "")
{
  GError *error = nullptr;
  GstElement *probe = gst_parse_launch ("gltestsrc num-buffers=1 ! gldownload ! fakesink", &error);
  g_clear_error (&error);
  if (!probe)
    return nullptr;
  gst_element_set_state (probe, GST_STATE_PAUSED);
  const bool usable =
      gst_element_get_state (probe, nullptr, nullptr, 60 * GST_SECOND) == GST_STATE_CHANGE_SUCCESS;
  gst_element_set_state (probe, GST_STATE_NULL);
  gst_object_unref (probe);
  if (!usable)
    return nullptr;
  const std::string launch =
      std::string ("striprender name=r ") + properties +
      " ! capsfilter name=size caps=\"video/x-raw(memory:GLMemory),width=320,height=240\" ! "
      "gldownload";
  GstHarness *h = gst_harness_new_parse (launch.c_str ());
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

struct Rendered {
  std::vector<guint8> rgba;
  guint8 at (int x, int y, int channel) const { return rgba[4 * (320 * y + x) + channel]; }
};

inline Rendered
render (GstHarness *h, GstBuffer *frame_set)
{
  GstBuffer *buffer = gst_harness_push_and_pull (h, frame_set);
  fail_unless (buffer != nullptr);
  Rendered picture;
  picture.rgba.resize (320 * 240 * 4);
  fail_unless_equals_int (
      gst_buffer_extract (buffer, 0, picture.rgba.data (), picture.rgba.size ()),
      picture.rgba.size ());
  gst_buffer_unref (buffer);
  return picture;
}

/* A flat wall 0.8 m before the first camera, in colours that change slowly. */
inline GstBuffer *
wall (const Rig &rig, GstClockTime pts = 0)
{
  GstBuffer *buffer = make_frame_set (rig, pts);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool inside = image.view_id == 0 && x >= 40 && x < 280 && y >= 30 && y < 210;
        image.depth.at (x, y) = inside ? 8000 : 0;
        image.colour.at (x, y) = {guint8 (x / 2 + 50), guint8 (y), guint8 (200 - x / 2), 0};
      }
  return buffer;
}

} // namespace rangecast::testing
