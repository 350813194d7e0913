/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* For tests of what striprender does in time and beside its strips: a harness, pictures,
 * statistics. */
#pragma once

#include <gst/gl/gl.h>
#include <gst/video/navigation.h>

#include <string>
#include <vector>

#include "rangecast-check.hpp"

namespace rangecast::testing {

/** Whether pipelines have an OpenGL here. */
inline bool
opengl_works ()
{
  GstElement *probe = gst_parse_launch ("gltestsrc num-buffers=1 ! gldownload ! fakesink", nullptr);
  if (!probe)
    return false;
  gst_element_set_state (probe, GST_STATE_PAUSED);
  const bool works =
      gst_element_get_state (probe, nullptr, nullptr, 60 * GST_SECOND) == GST_STATE_CHANGE_SUCCESS;
  gst_element_set_state (probe, GST_STATE_NULL);
  gst_object_unref (probe);
  return works;
}

struct RenderOptions {
  const char *properties = "";                 ///< of striprender
  const char *output = "width=320,height=240"; ///< caps fields
  int fps_n = 30, fps_d = 1;                   ///< of the frame sets
};

/** striprender and gldownload; nullptr where there is no OpenGL. Its upstream is live, its clock a
 *  test clock. */
inline GstHarness *
new_render_harness (const Rig &rig, const RenderOptions &options = {})
{
  if (!opengl_works ())
    return nullptr;
  const std::string launch = std::string ("striprender name=r ") + options.properties +
                             " ! capsfilter name=output caps=\"video/x-raw(memory:GLMemory)," +
                             options.output + "\" ! gldownload";
  GstHarness *h = gst_harness_new_parse (launch.c_str ());
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA");
  gst_harness_set_src_caps (
      h, gstrange::make_range_caps (gstrange::make_info (rig, options.fps_n, options.fps_d)));
  return h;
}

/** A picture of RGBA as it came out. */
struct RenderedPicture {
  int width = 0, height = 0;
  GstClockTime pts = 0, duration = 0, shows = 0; ///< `shows`: capture time of the frame set
  std::vector<guint8> rgba;

  [[nodiscard]] const guint8 *at (int x, int y) const { return &rgba[4 * (width * y + x)]; }
  /** A part of it, without times. */
  [[nodiscard]] RenderedPicture part (int x, int y, int part_width, int part_height) const
  {
    RenderedPicture result;
    result.width = part_width;
    result.height = part_height;
    for (int row = y; row < y + part_height; row++)
      result.rgba.insert (result.rgba.end (), at (x, row), at (x, row) + 4 * part_width);
    return result;
  }
};

/** @param buffer  transfer full, with `width` pixels a row */
inline RenderedPicture
take_rendered (GstBuffer *buffer, int width)
{
  fail_unless (buffer != nullptr, "no picture came out");
  RenderedPicture picture;
  picture.rgba.resize (gst_buffer_get_size (buffer));
  gst_buffer_extract (buffer, 0, picture.rgba.data (), picture.rgba.size ());
  picture.width = width;
  picture.height = int (picture.rgba.size () / 4) / width;
  picture.pts = GST_BUFFER_PTS (buffer);
  picture.duration = GST_BUFFER_DURATION (buffer);
  picture.shows = gst_range_buffer_get_capture_time (buffer);
  gst_buffer_unref (buffer);
  return picture;
}

inline guint64
stats_field (GstElement *striprender, const char *name)
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  g_object_get (striprender, "stats", &stats, nullptr);
  fail_unless (gst_structure_get_uint64 (stats, name, &value), "no %s in stats", name);
  gst_structure_free (stats);
  return value;
}

inline void
set_output_caps (GstElement *bin, const char *fields)
{
  GstElement *filter = gst_bin_get_by_name (GST_BIN (bin), "output");
  gst_util_set_object_arg (
      G_OBJECT (filter), "caps", (std::string ("video/x-raw(memory:GLMemory),") + fields).c_str ());
  gst_object_unref (filter);
}

} // namespace rangecast::testing
