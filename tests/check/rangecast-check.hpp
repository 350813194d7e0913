/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the element tests share: sample rigs, caps and frame sets, bus errors, skips. */
#pragma once

#include <gst/check/gstcheck.h>
#include <gst/check/gstharness.h>

#include <cmath>
#include <cstdlib>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <string>

#include "values-check.hpp"

/** Says why a test did not run; the test runner counts these lines. */
#define RANGECAST_SKIP(reason)                                                                     \
  do {                                                                                             \
    g_print ("SKIP: %s: %s\n", __func__, reason);                                                  \
    return;                                                                                        \
  } while (0)

namespace rangecast::testing {

/** Ignores a warning of GStreamer 1.22, which stores an event at a pad that was deactivated while
 * it passed: chance decides whether a pipeline that a test ends at its beginning does so. */
inline GstCheckLogFilter *const kStickyOrderFilter = gst_check_add_log_filter (
    "GStreamer", G_LOG_LEVEL_WARNING,
    g_regex_new ("got 'segment' before 'stream-start'", {}, {}, nullptr),
    [] (const gchar *, GLogLevelFlags, const gchar *, gpointer) -> gboolean { return TRUE; },
    nullptr, nullptr);

/** RANGECAST_DATA, else ../shared/data beside the source tree; empty where neither is there. */
inline std::string
data_dir ()
{
  if (const gchar *named = g_getenv ("RANGECAST_DATA"))
    return g_file_test (named, G_FILE_TEST_IS_DIR) ? named : "";
  const gchar *source = g_getenv ("RANGECAST_SOURCE");
  const std::string path = std::string (source ? source : ".") + "/../shared/data";
  return g_file_test (path.c_str (), G_FILE_TEST_IS_DIR) ? path : "";
}

/** Cameras on a ring of 0.8 m about the y axis, looking at the origin; view 0 stands on +z. */
inline Rig
ring_rig (int views, int width = 320, int height = 240)
{
  Rig rig;
  for (int id = 0; id < views; id++) {
    const double a = 2 * M_PI * id / views, s = std::sin (a), c = std::cos (a);
    View view;
    view.id = id;
    view.width = width;
    view.height = height;
    view.intrinsics = {double (width), double (width), (width - 1) / 2.0, (height - 1) / 2.0};
    view.world_from_view = {{c, 0, -s, 0, -1, 0, -s, 0, -c}, {0.8 * s, 0, 0.8 * c}};
    view.near_m = 0.3;
    view.far_m = 1.5;
    rig.views.push_back (view);
  }
  return rig;
}

/** A frame set of the rig's views with that ROI (all rows and columns if empty): a smooth bump
 *  0.6 to 0.8 m away (units of 0.1 mm) in the ROI's middle ellipse, invalid around it, colours that
 *  differ from pixel to pixel. PTS = capture time = `time`. */
inline GstBuffer *
make_frame_set (const Rig &rig, GstClockTime time = 0, Roi roi = {})
{
  GstBuffer *buffer =
      gst_range_buffer_new (rig.views.size (), rig.views[0].width, rig.views[0].height);
  for (const View &view : rig.views) {
    const Roi r = roi.empty () ? Roi{0, 0, view.width, view.height} : roi;
    gst_range_buffer_add_view (buffer, view.id, r.x, r.y, r.width, r.height, time);
  }
  gst_range_buffer_set_capture_time (buffer, time);
  GST_BUFFER_PTS (buffer) = time;
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  fail_unless_ok (frame.status ());
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++) {
        const double u = 2.0 * (x + 0.5) / image.roi.width - 1;
        const double v = 2.0 * (y + 0.5) / image.roi.height - 1;
        const double d = u * u + v * v;
        image.depth.at (x, y) = d < 0.8 ? static_cast<std::uint16_t> (6000 + 2000 * d) : 0;
        image.colour.at (x, y) = {static_cast<std::uint8_t> (x), static_cast<std::uint8_t> (y),
            static_cast<std::uint8_t> (x + 2 * y + 40 * image.view_id), 0};
      }
  return buffer;
}

/** How many times as long as usual a camera's work may take: RANGECAST_SLOWDOWN, else 1. */
inline int
slowdown ()
{
  const char *text = g_getenv ("RANGECAST_SLOWDOWN");
  return text ? std::max (1, atoi (text)) : 1;
}

/** Waits for the bus's next error (or warning) and gives its text; empty if none comes in time. */
inline std::string
next_message_text (GstBus *bus, GstMessageType type, GstClockTime timeout = 60 * GST_SECOND)
{
  GstMessage *message = gst_bus_timed_pop_filtered (bus, timeout, type);
  if (!message)
    return "";
  GError *error = nullptr;
  if (type == GST_MESSAGE_ERROR)
    gst_message_parse_error (message, &error, nullptr);
  else
    gst_message_parse_warning (message, &error, nullptr);
  const std::string text = error->message;
  g_error_free (error);
  gst_message_unref (message);
  return text;
}

/** Begins a segment behind `start`, as a seek to between two frames does, and pushes a frame set of
 *  `start`, which has no stream time then: controlled properties must stay, without a warning. */
inline GstBuffer *
push_before_the_segment (GstHarness *h, const Rig &rig, GstClockTime start)
{
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.start = segment.time = segment.position = start + 1;
  fail_unless (gst_harness_push_event (h, gst_event_new_segment (&segment)));
  return gst_harness_push_and_pull (h, make_frame_set (rig, start));
}

/** Plays a pipeline until EOS, which must come before any error and within 120 s, and stops it. */
inline void
play_to_the_end (GstElement *pipeline)
{
  ck_assert_int_ne (gst_element_set_state (pipeline, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 120 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  fail_unless (message);
  ck_assert_int_eq (GST_MESSAGE_TYPE (message), GST_MESSAGE_EOS);
  gst_message_unref (message);
  gst_object_unref (bus);
  gst_element_set_state (pipeline, GST_STATE_NULL);
}

/** A counter in `stats`, or in another property that holds a structure. */
inline guint64
stats_field (GstElement *element, const char *name, const char *property = "stats")
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  g_object_get (element, property, &stats, nullptr);
  fail_unless (gst_structure_get_uint64 (stats, name, &value), "no %s in %s", name, property);
  gst_structure_free (stats);
  return value;
}

/** The same of an element in a harness. */
inline guint64
stats_field (GstHarness *h, const char *factory, const char *name)
{
  GstElement *element = gst_harness_find_element (h, factory);
  const guint64 value = stats_field (element, name);
  gst_object_unref (element);
  return value;
}

} // namespace rangecast::testing
