/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests of striprender share: a harness that downloads its pictures, its statistics, and a
 * wall to draw. */
#pragma once

#include <gst/gl/gl.h>
#include <gst/video/navigation.h>

#include <string>
#include <vector>

#include "../rangecast-check.hpp"

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

#define SKIP_WITHOUT_OPENGL()                                                                      \
  do {                                                                                             \
    if (!opengl_works ())                                                                          \
      RANGECAST_SKIP ("no OpenGL context");                                                        \
  } while (0)

struct RenderOptions {
  const char *properties = "";                 ///< of striprender
  const char *output = "width=320,height=240"; ///< caps fields
  int fps_n = 30, fps_d = 1;                   ///< of the frame sets
  bool opengl = false;                         ///< draws with it; else in software
};

/** striprender, `r`. Its upstream is live, its clock a test clock. */
inline GstHarness *
render_harness (const Rig &rig, const RenderOptions &options = {})
{
  const std::string gl = options.opengl ? "backend=opengl " : "backend=software ",
                    launch = "striprender name=r " + gl + options.properties +
                             " ! capsfilter name=output caps=video/x-raw" +
                             (options.opengl ? "(memory:GLMemory)," : ",") + options.output +
                             (options.opengl ? " ! gldownload" : "");
  GstHarness *h = gst_harness_new_parse (launch.c_str ());
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA");
  gst_harness_set_src_caps (
      h, gstrange::make_range_caps (gstrange::make_info (rig, options.fps_n, options.fps_d)));
  return h;
}

/** The same, 320x240 out. */
inline GstHarness *
render_harness (const Rig &rig, const char *properties)
{
  return render_harness (rig, RenderOptions{properties});
}

/** A picture of RGBA as it came out. */
struct RenderedPicture {
  int width = 0, height = 0;
  GstClockTime pts = 0, duration = 0, shows = 0; ///< `shows`: capture time of the frame set
  bool discont = false;
  std::vector<guint8> rgba;

  [[nodiscard]] const guint8 *at (int x, int y) const { return &rgba[4 * (width * y + x)]; }
  [[nodiscard]] guint8 at (int x, int y, int channel) const { return at (x, y)[channel]; }
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
  picture.discont = GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  picture.shows = gst_range_buffer_get_capture_time (buffer);
  gst_buffer_unref (buffer);
  return picture;
}

/** Pushes a frame set, transfer full, and takes its picture. */
inline RenderedPicture
render (GstHarness *h, GstBuffer *frame_set, int width = 320)
{
  return take_rendered (gst_harness_push_and_pull (h, frame_set), width);
}

/** A wall through the origin that two cameras see, 40 degrees apart, in red and in green; what the
 *  first one sees is rough. */
inline GstBuffer *
wall_of_two (const Rig &rig)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ()) {
    const View &view = *rig.find (image.view_id);
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const Vec3 ray = view.world_from_view.rotation * view.intrinsics.unproject (x, y, 1);
        const double z = view.world_from_view.translation.z / -ray.z; /* to the plane z = 0 */
        const int noise = image.view_id == 0 ? (x * 7 + y * 13) % 11 - 5 : 0;
        image.depth.at (x, y) = guint16 (std::lround (z * 10000) + 2 * noise);
        image.colour.at (x, y) = image.view_id == 0 ? Rgbx{255, 0, 0, 0} : Rgbx{0, 255, 0, 0};
      }
  }
  return buffer;
}

inline void
set_output_caps (GstElement *bin, const char *fields)
{
  GstElement *filter = gst_bin_get_by_name (GST_BIN (bin), "output");
  gst_util_set_object_arg (
      G_OBJECT (filter), "caps", (std::string ("video/x-raw,") + fields).c_str ());
  gst_object_unref (filter);
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

/** The period of most outputs that have a rate of their own. */
inline constexpr GstClockTime kPeriod = GST_SECOND / 10;

/** striprender behind a live stream of frame sets of 200 ms, with a frame rate of its own. */
struct Live {
  GstHarness *h;
  GstElement *r; ///< striprender
  GstPad *src;   ///< its pad
  GstTestClock *clock;
  Rig rig = ring_rig (1);

  explicit Live (
      const char *properties = "", const char *output = "framerate=10/1", bool opengl = false)
  {
    const std::string caps = std::string ("width=320,height=240,") + output;
    h = render_harness (rig, {properties, caps.c_str (), 5, 1, opengl});
    r = gst_bin_get_by_name (GST_BIN (h->element), "r");
    src = gst_element_get_static_pad (r, "src");
    clock = gst_harness_get_testclock (h);
  }
  ~Live ()
  {
    gst_object_unref (src);
    gst_object_unref (r);
    gst_object_unref (clock);
    gst_harness_teardown (h);
  }
  void push (GstClockTime pts)
  {
    GstBuffer *set = make_frame_set (rig, pts);
    GST_BUFFER_DURATION (set) = 200 * GST_MSECOND;
    fail_unless_equals_int (gst_harness_push (h, set), GST_FLOW_OK);
  }
  /** Lets the clock go on to what the element waits for, and takes the picture. */
  RenderedPicture next (int width = 320)
  {
    fail_unless (gst_harness_crank_single_clock_wait (h));
    return take_rendered (gst_harness_pull (h), width);
  }
  /** Lets that much time go by while the thread waits, which then goes on. */
  void sleep (GstClockTime time)
  {
    gst_test_clock_wait_for_next_pending_id (clock, nullptr);
    gst_test_clock_advance_time (clock, time);
    GstClockID id = gst_test_clock_process_next_clock_id (clock);
    fail_unless (id != nullptr);
    gst_clock_id_unref (id);
  }
  GstClockTime now () { return gst_clock_get_time (GST_CLOCK (clock)); }
};

} // namespace rangecast::testing
