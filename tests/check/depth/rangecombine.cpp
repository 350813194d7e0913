/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <unistd.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr const char *kColour = "video/x-raw,format=RGB,width=5,height=3,framerate=10/1",
                            *kDepth =
                                "video/x-raw,format=GRAY16_LE,width=5,height=3,framerate=10/1";

struct Combine {
  GstHarness *colour, *depth;
  GstBus *bus = gst_bus_new ();

  explicit Combine (const char *colour_caps = kColour, const char *depth_caps = kDepth,
      const char *properties = "")
  {
    GstElement *element =
        gst_parse_launch ((std::string ("rangecombine ") + properties).c_str (), nullptr);
    colour = gst_harness_new_with_element (element, "colour", "src");
    depth = gst_harness_new_with_element (element, "depth", nullptr);
    gst_element_set_bus (element, bus);
    gst_object_unref (element);
    gst_harness_set_src_caps_str (colour, colour_caps);
    gst_harness_set_src_caps_str (depth, depth_caps);
  }
  ~Combine ()
  {
    gst_element_set_bus (colour->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (depth);
    gst_harness_teardown (colour);
  }
  void push_colour (GstClockTime pts, guint8 value)
  {
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, 16 * 3, nullptr); /* rows of 15 + 1 */
    gst_buffer_memset (buffer, 0, value, 16 * 3);
    GST_BUFFER_PTS (buffer) = pts;
    gst_harness_push (colour, buffer);
  }
  void push_depth (GstClockTime pts, guint16 millimetres)
  {
    guint16 rows[3][6]; /* rows of 10 + 2 bytes */
    for (auto &row : rows)
      for (guint16 &d : row)
        d = GUINT16_TO_LE (millimetres);
    rows[2][4] = 0;
    GstBuffer *buffer = gst_buffer_new_memdup (rows, sizeof rows);
    GST_BUFFER_PTS (buffer) = pts;
    gst_harness_push (depth, buffer);
  }
};

GST_START_TEST (test_millimetres_become_depth_units_and_colour_stays)
{
  for (const bool big_endian : {false, true}) {
    Combine c (kColour,
        big_endian ? "video/x-raw,format=GRAY16_BE,width=5,height=3,framerate=10/1" : kDepth);
    c.push_colour (0, 77);
    c.push_depth (0, big_endian ? GUINT16_SWAP_LE_BE (1234) : 1234);
    GstBuffer *output = gst_harness_pull (c.colour);
    {
      gstrange::RangeFrameMap frame (output, GST_MAP_READ);
      const RangeImage &image = frame.views ()[0];
      fail_unless_cmp (image.roi, ==, (Roi{0, 0, 5, 3}));
      fail_unless_equals_int (image.depth.at (3, 2), 12340);
      fail_unless_equals_int (image.depth.at (4, 2), 0);
      fail_unless_equals_int (image.colour.at (4, 2).r, 77);
      fail_unless_equals_int (image.colour.at (0, 0).b, 77);
    }
    gst_buffer_unref (output);
  }
}
GST_END_TEST;

GST_START_TEST (test_depth_outside_near_and_far_is_invalid)
{
  Combine c (
      kColour, kDepth, "near=0.7 far=2.3"); /* neither is a whole number of depth units in binary */
  for (guint16 millimetres : {699, 700, 2300, 2301}) {
    c.push_colour (GST_SECOND * millimetres, 0);
    c.push_depth (GST_SECOND * millimetres, millimetres);
    GstBuffer *output = gst_harness_pull (c.colour);
    {
      gstrange::RangeFrameMap frame (output, GST_MAP_READ);
      const bool valid = millimetres >= 700 && millimetres <= 2300;
      fail_unless_equals_int (frame.views ()[0].depth.at (0, 0), valid ? 10 * millimetres : 0);
    }
    gst_buffer_unref (output);
  }
}
GST_END_TEST;

/* 8 m are 80000 steps of the usual 0.1 mm. */
GST_START_TEST (test_far_beyond_16_bits_chooses_a_larger_depth_unit)
{
  Combine c (kColour, kDepth, "far=8");
  c.push_colour (0, 0);
  c.push_depth (0, 7000);
  GstBuffer *output = gst_harness_pull (c.colour);
  GstCaps *caps = gst_pad_get_current_caps (GST_PAD_PEER (c.colour->sinkpad));
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  gst_caps_unref (caps);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    const double unit = info.rig.views[0].depth_unit_m;
    fail_unless (std::abs (frame.views ()[0].depth.at (0, 0) * unit - 7) <= unit / 2);
  }
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_focal_length_of_a_larger_image_is_a_warning_with_the_field_of_view)
{
  for (const bool usual : {false, true}) {
    Combine c (kColour, kDepth, usual ? "focal-length=5" : "focal-length=30");
    c.push_colour (0, 0);
    c.push_depth (0, 1000);
    gst_buffer_unref (gst_harness_pull (c.colour));
    if (usual)
      fail_unless (gst_bus_pop_filtered (c.bus, GST_MESSAGE_WARNING) == nullptr);
    else
      fail_unless_contains (next_message_text (c.bus, GST_MESSAGE_WARNING),
          "the depth images of 5x3 a field of view of 9.5 degrees");
  }
}
GST_END_TEST;

/* In the first frames with depth, or at the end of a shorter stream. */
GST_START_TEST (test_wrong_depth_scale_is_one_warning_that_names_it)
{
  for (const guint64 frames : {1, 8}) {
    Combine c; /* millimetres: 12 m is beyond far */
    for (guint64 i = 0; i < frames; i++) {
      c.push_colour (i * 100 * GST_MSECOND, 1);
      c.push_depth (i * 100 * GST_MSECOND, 12000);
      gst_buffer_unref (gst_harness_pull (c.colour));
    }
    for (GstHarness *h : {c.colour, c.depth})
      gst_harness_push_event (h, gst_event_new_eos ());
    const std::string text = next_message_text (c.bus, GST_MESSAGE_WARNING);
    fail_unless_contains (text, "depth-scale=0.001");
    fail_unless_contains (text, "12000");
    fail_unless (gst_bus_pop_filtered (c.bus, GST_MESSAGE_WARNING) == nullptr);
  }
}
GST_END_TEST;

GST_START_TEST (test_pairs_by_pts_and_drops_what_has_no_partner)
{
  Combine c;
  c.push_depth (100 * GST_MSECOND, 1000);
  c.push_colour (0, 1);                 /* older than any depth: dropped */
  c.push_colour (130 * GST_MSECOND, 2); /* within half a frame of 100 ms */
  c.push_depth (200 * GST_MSECOND, 1001);
  c.push_depth (300 * GST_MSECOND, 1002);
  c.push_colour (300 * GST_MSECOND, 3);
  for (int expected : {1000, 1002}) {
    GstBuffer *output = gst_harness_pull (c.colour);
    {
      gstrange::RangeFrameMap frame (output, GST_MAP_READ);
      fail_unless_equals_int (frame.views ()[0].depth.at (0, 0), 10 * expected);
      fail_unless_equals_int (frame.views ()[0].colour.at (0, 0).r, expected == 1000 ? 2 : 3);
    }
    gst_buffer_unref (output);
  }
  fail_unless_equals_uint64 (stats_field (c.colour->element, "dropped-colour"), 1);
  fail_unless_equals_uint64 (stats_field (c.colour->element, "dropped-depth"), 1);
}
GST_END_TEST;

GST_START_TEST (test_capture_time_comes_from_the_colour_camera)
{
  Combine c;
  GstBuffer *colour = gst_buffer_new_allocate (nullptr, 48, nullptr);
  gst_buffer_memset (colour, 0, 9, 48);
  GST_BUFFER_PTS (colour) = GST_SECOND;
  gst_range_buffer_set_capture_time (colour, 123456789);
  gst_harness_push (c.colour, colour);
  c.push_depth (GST_SECOND, 1000);
  GstBuffer *output = gst_harness_pull (c.colour);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 123456789);
  fail_unless_equals_uint64 (gst_buffer_get_range_meta (output, 0)->capture_time, 123456789);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), GST_SECOND);
  fail_unless_equals_uint64 (GST_BUFFER_DURATION (output), GST_SECOND / 10);
  gst_buffer_unref (output);
}
GST_END_TEST;

/* A buffer of one value, of the size that the caps give. */
static GstBuffer *
flat (guint width, guint height, guint bytes, guint16 value, GstClockTime pts)
{
  GstBuffer *buffer =
      gst_buffer_new_allocate (nullptr, GST_ROUND_UP_4 (width * bytes) * height, nullptr);
  GstMapInfo map;
  gst_buffer_map (buffer, &map, GST_MAP_WRITE);
  for (gsize i = 0; i < map.size; i++) /* little-endian depth; colour all alike */
    map.data[i] = static_cast<guint8> (bytes == 2 && i % 2 ? value >> 8 : value & 255);
  gst_buffer_unmap (buffer, &map);
  GST_BUFFER_PTS (buffer) = pts;
  return buffer;
}

GST_START_TEST (test_colour_of_more_pixels_comes_out_at_either_size)
{
  const struct {
    const char *properties;
    int width, height;
  } cases[] = {{"near=0.5", 8, 6}, {"near=0.5 into=depth", 8, 6}, {"near=0.5 into=colour", 16, 12}};
  for (const auto &it : cases) {
    Combine c ("video/x-raw,format=RGB,width=16,height=12,framerate=10/1",
        "video/x-raw,format=GRAY16_LE,width=8,height=6,framerate=10/1", it.properties);
    gst_harness_push (c.colour, flat (16, 12, 3, 77, 0));
    gst_harness_push (c.depth, flat (8, 6, 2, 1500, 0));
    GstBuffer *output = gst_harness_pull (c.colour);
    {
      gstrange::RangeFrameMap frame (output, GST_MAP_READ);
      const RangeImage &image = frame.views ()[0];
      fail_unless_cmp (image.roi, ==, (Roi{0, 0, it.width, it.height}));
      for (int y = 0; y < it.height; y++)
        for (int x = 0; x < it.width; x++) {
          fail_unless_equals_int (image.depth.at (x, y), 15000);
          fail_unless_equals_int (image.colour.at (x, y).g, 77);
        }
    }
    gst_buffer_unref (output);
  }
}
GST_END_TEST;

static std::string
rig_of_two (const char *name)
{
  Rig rig;
  for (int id : {2, 7}) {
    View view = ring_rig (1, id == 2 ? 32 : 64, id == 2 ? 24 : 48).views[0];
    view.id = id;
    view.world_from_view.translation.x = id == 2 ? 0 : 0.05;
    view.far_m = 3;
    rig.views.push_back (view);
  }
  const std::string path =
      std::string (g_get_tmp_dir ()) + "/" + name + std::to_string (getpid ()) + ".yaml";
  fail_unless_ok (save_rig (path, rig));
  return path;
}

GST_START_TEST (test_colour_camera_of_the_rig_is_registered_into_either_view)
{
  const std::string path = rig_of_two ("rangecombine-two-");
  for (const bool into_colour : {false, true}) {
    const std::string properties =
        "rig=" + path + " view-id=2 colour-view-id=7 into=" + (into_colour ? "colour" : "depth");
    /* Pictures of twice the rig's size: the calibration is scaled. */
    Combine c ("video/x-raw,format=RGB,width=128,height=96,framerate=10/1",
        "video/x-raw,format=GRAY16_LE,width=64,height=48,framerate=10/1", properties.c_str ());
    gst_harness_push (c.colour, flat (128, 96, 3, 77, 0));
    gst_harness_push (c.depth, flat (64, 48, 2, 1000, 0));
    GstBuffer *output = gst_harness_pull (c.colour);
    {
      gstrange::RangeFrameMap frame (output, GST_MAP_READ);
      const RangeImage &image = frame.views ()[0];
      fail_unless_equals_int (image.view_id, into_colour ? 7 : 2);
      fail_unless_equals_int (image.roi.width, into_colour ? 128 : 64);
      const int last = image.roi.width - 1, row = image.roi.height / 2;
      fail_unless_equals_int (image.depth.at (last / 2, row), 10000);
      /* The colour camera stands 5 cm to the right: at 1 m that is 5 % of the picture's width. */
      const int strip = image.roi.width / 25;
      ck_assert_int_eq ((image.depth.at (0, row) == 0), !into_colour);
      ck_assert_int_eq ((image.depth.at (strip / 2, row) == 0), !into_colour);
      ck_assert_int_eq ((image.depth.at (last, row) == 0), into_colour);
    }
    gst_buffer_unref (output);
  }
  g_unlink (path.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_what_does_not_fit_together_is_one_error_that_names_it)
{
  const std::string path = rig_of_two ("rangecombine-shape-");
  const struct {
    int width, height; /* of depth */
    std::string properties, error;
  } cases[] = {{64, 36, "", "pad depth is 64x36"},
      {64, 36, "rig=" + path + " view-id=2 colour-view-id=7", path},
      {64, 48, "colour-view-id=1", "colour-view-id"},
      {64, 48, "rig=/nowhere/rig.yaml", "/nowhere/rig.yaml"}};
  for (const auto &it : cases) {
    const std::string caps =
        "video/x-raw,format=GRAY16_LE,framerate=10/1,width=" + std::to_string (it.width) +
        ",height=" + std::to_string (it.height);
    Combine c ("video/x-raw,format=RGB,width=64,height=48,framerate=10/1", caps.c_str (),
        it.properties.c_str ());
    gst_harness_push (c.colour, flat (64, 48, 3, 77, 0));
    gst_harness_push (c.depth, flat (guint (it.width), guint (it.height), 2, 1000, 0));
    fail_unless_contains (next_message_text (c.bus, GST_MESSAGE_ERROR), it.error);
    fail_unless (gst_bus_pop_filtered (c.bus, GST_MESSAGE_ERROR) == nullptr);
  }
  g_unlink (path.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_streams_of_different_rates_give_the_slower_one_with_the_nearest_partner)
{
  for (const bool colour_is_fast : {true, false}) {
    const char *const fast = ",framerate=30/1", *const slow = ",framerate=10/1";
    const std::string colour = "video/x-raw,format=RGB,width=5,height=3";
    const std::string depth = "video/x-raw,format=GRAY16_LE,width=5,height=3";
    Combine c ((colour + (colour_is_fast ? fast : slow)).c_str (),
        (depth + (colour_is_fast ? slow : fast)).c_str ());
    const GstClockTime late = 10 * GST_MSECOND; /* by which the slow one is beside the fast one */
    for (guint i = 0; i < 12; i++) {
      const GstClockTime pts = gst_util_uint64_scale (i, GST_SECOND, 30);
      if (i % 3 == 0 && colour_is_fast)
        c.push_depth (pts + late, static_cast<guint16> (1000 + i));
      else if (i % 3 == 0)
        c.push_colour (pts + late, static_cast<guint8> (i));
      if (colour_is_fast)
        c.push_colour (pts, static_cast<guint8> (i));
      else
        c.push_depth (pts, static_cast<guint16> (1000 + i));
    }
    for (guint i = 0; i < 12; i += 3) {
      GstBuffer *output = gst_harness_pull (c.colour);
      fail_unless_equals_uint64 (GST_BUFFER_DURATION (output), GST_SECOND / 10);
      {
        gstrange::RangeFrameMap frame (output, GST_MAP_READ);
        fail_unless_equals_int (frame.views ()[0].depth.at (0, 0), 10 * (1000 + int (i)));
        fail_unless_equals_int (frame.views ()[0].colour.at (0, 0).r, i);
      }
      gst_buffer_unref (output);
    }
    GstCaps *caps = gst_pad_get_current_caps (GST_PAD_PEER (c.colour->sinkpad));
    gint n = 0, d = 0;
    gst_structure_get_fraction (gst_caps_get_structure (caps, 0), "framerate", &n, &d);
    fail_unless_equals_int (n, 10);
    gst_caps_unref (caps);
  }
}
GST_END_TEST;

GST_START_TEST (test_new_size_in_the_stream_is_taken)
{
  Combine c;
  c.push_colour (0, 1);
  c.push_depth (0, 1000);
  gst_buffer_unref (gst_harness_pull (c.colour));
  gst_harness_set_src_caps_str (
      c.colour, "video/x-raw,format=GRAY8,width=4,height=2,framerate=10/1");
  gst_harness_set_src_caps_str (
      c.depth, "video/x-raw,format=GRAY16_LE,width=4,height=2,framerate=10/1");
  GstBuffer *colour = gst_buffer_new_memdup ("abcdefgh", 8);
  GstBuffer *depth = gst_buffer_new_allocate (nullptr, 16, nullptr);
  gst_buffer_memset (depth, 0, 4, 16);
  GST_BUFFER_PTS (colour) = GST_BUFFER_PTS (depth) = GST_SECOND;
  gst_harness_push (c.colour, colour);
  gst_harness_push (c.depth, depth);
  GstBuffer *output = gst_harness_pull (c.colour);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    fail_unless_cmp (frame.views ()[0].roi, ==, (Roi{0, 0, 4, 2}));
    fail_unless_equals_int (frame.views ()[0].depth.at (3, 1), 10280);
  }
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_changes_states_twice)
{
  GstElement *pipeline =
      gst_parse_launch ("videotestsrc num-buffers=3 ! video/x-raw,format=GRAY16_LE ! c.depth "
                        "videotestsrc num-buffers=3 ! c.colour rangecombine name=c ! fakesink",
          nullptr);
  for (int i = 0; i < 2; i++)
    play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* The first buffer of an appsink, and its caps. */
static GstSample *
pull_preroll (GstElement *pipeline, const char *name)
{
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), name);
  GstSample *sample = nullptr;
  g_signal_emit_by_name (sink, "pull-preroll", &sample);
  gst_object_unref (sink);
  fail_unless (sample != nullptr, "%s", name);
  return sample;
}

static GstPadProbeReturn
stamp_an_hour_ahead (GstPad *, GstPadProbeInfo *info, gpointer)
{
  GST_BUFFER_PTS (GST_PAD_PROBE_INFO_BUFFER (info)) += 3600 * GST_SECOND;
  return GST_PAD_PROBE_OK;
}

/* openni2src counts from its own first frame, fdsrc from another base time. */
GST_START_TEST (test_do_timestamp_pairs_live_streams_whose_times_differ_by_an_hour)
{
  GstElement *pipeline = gst_parse_launch (
      "videotestsrc is-live=true num-buffers=10 ! video/x-raw,framerate=10/1,width=64,height=48 "
      "! queue ! c.colour videotestsrc is-live=true num-buffers=10 "
      "! video/x-raw,format=GRAY16_LE,framerate=10/1,width=64,height=48 ! identity name=camera "
      "! queue ! c.depth  rangecombine name=c do-timestamp=true ! fakesink name=out",
      nullptr);
  GstElement *camera = gst_bin_get_by_name (GST_BIN (pipeline), "camera"),
             *combine = gst_bin_get_by_name (GST_BIN (pipeline), "c"),
             *out = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstPad *pad = gst_element_get_static_pad (camera, "src");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, stamp_an_hour_ahead, nullptr, nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstMessage *end = gst_bus_timed_pop_filtered (
      bus, 60 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  fail_unless (end && GST_MESSAGE_TYPE (end) == GST_MESSAGE_EOS);
  gst_message_unref (end);
  fail_unless (stats_field (combine, "frames") >= 1); /* a busy machine drops some */
  GstSample *last = nullptr;
  g_object_get (out, "last-sample", &last, nullptr);
  const GstClockTime pts = GST_BUFFER_PTS (gst_sample_get_buffer (last));
  fail_unless (pts > 0 && pts < 3600 * GST_SECOND, "PTS %" GST_TIME_FORMAT, GST_TIME_ARGS (pts));
  gst_sample_unref (last);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pad);
  for (GstElement *element : {out, camera, combine, pipeline})
    gst_object_unref (element);
}
GST_END_TEST;

/* Through an element that keeps what it does not know of caps, too. */
GST_START_TEST (test_takes_back_what_rangesplit_gave_without_properties)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc num-buffers=1 views=3 arc=90 ! tee name=t  t. ! queue ! appsink name=whole "
      "t. ! queue ! rangesplit name=s  s.colour_2 ! queue ! videoconvert ! c.colour "
      "s.depth_2 ! queue ! videorate ! c.depth  rangecombine name=c ! appsink name=combined",
      nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstSample *whole = pull_preroll (pipeline, "whole"),
            *combined = pull_preroll (pipeline, "combined");
  GstRangeCamera before, after;
  fail_unless (gst_range_caps_get_camera (gst_sample_get_caps (whole), 2, &before));
  fail_unless (gst_range_caps_get_camera (gst_sample_get_caps (combined), 2, &after));
  fail_unless_equals_float (after.fx, before.fx);
  fail_unless_equals_float (after.depth_unit, before.depth_unit);
  fail_unless_equals_float (after.min_depth, before.min_depth);
  fail_unless_equals_float (after.max_depth, before.max_depth);
  for (int i = 0; i < 12; i++)
    fail_unless_equals_float (after.world_from_view[i], before.world_from_view[i]);
  {
    gstrange::RangeFrameMap from (gst_sample_get_buffer (whole), GST_MAP_READ);
    gstrange::RangeFrameMap to (gst_sample_get_buffer (combined), GST_MAP_READ);
    const auto &image = from.views ()[2], &made = to.views ()[0];
    fail_unless_equals_int (made.view_id, 2);
    fail_unless (count_points (image) > 1000);
    fail_unless_equals_uint64 (count_points (made), count_points (image));
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        fail_unless_equals_int (
            made.depth.row (image.roi.y + y)[image.roi.x + x], image.depth.row (y)[x]);
  }
  gst_sample_unref (whole);
  gst_sample_unref (combined);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_invalid_calibration_is_one_error_that_names_the_field)
{
  Combine combine;
  GstCaps *caps =
      gst_caps_from_string ("video/x-raw,format=GRAY16_LE,width=5,height=3,framerate=10/1");
  GstBuffer *garbage = gst_buffer_new_memdup ("garbage", 7);
  gst_caps_set_simple (caps, "rig", GST_TYPE_BUFFER, garbage, nullptr);
  gst_buffer_unref (garbage);
  gst_harness_push_event (combine.depth, gst_event_new_caps (caps));
  gst_caps_unref (caps);
  fail_unless_contains (next_message_text (combine.bus, GST_MESSAGE_ERROR), "field \"rig\"");
  fail_unless (gst_bus_pop_filtered (combine.bus, GST_MESSAGE_ERROR) == nullptr);
}
GST_END_TEST;

static Suite *
rangecombine_suite ()
{
  Suite *suite = suite_create ("rangecombine");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_millimetres_become_depth_units_and_colour_stays);
  tcase_add_test (tc, test_depth_outside_near_and_far_is_invalid);
  tcase_add_test (tc, test_far_beyond_16_bits_chooses_a_larger_depth_unit);
  tcase_add_test (tc, test_focal_length_of_a_larger_image_is_a_warning_with_the_field_of_view);
  tcase_add_test (tc, test_wrong_depth_scale_is_one_warning_that_names_it);
  tcase_add_test (tc, test_pairs_by_pts_and_drops_what_has_no_partner);
  tcase_add_test (tc, test_capture_time_comes_from_the_colour_camera);
  tcase_add_test (tc, test_colour_of_more_pixels_comes_out_at_either_size);
  tcase_add_test (tc, test_colour_camera_of_the_rig_is_registered_into_either_view);
  tcase_add_test (tc, test_what_does_not_fit_together_is_one_error_that_names_it);
  tcase_add_test (tc, test_streams_of_different_rates_give_the_slower_one_with_the_nearest_partner);
  tcase_add_test (tc, test_new_size_in_the_stream_is_taken);
  tcase_add_test (tc, test_changes_states_twice);
  tcase_add_test (tc, test_do_timestamp_pairs_live_streams_whose_times_differ_by_an_hour);
  tcase_add_test (tc, test_takes_back_what_rangesplit_gave_without_properties);
  tcase_add_test (tc, test_invalid_calibration_is_one_error_that_names_the_field);
  return suite;
}

GST_CHECK_MAIN (rangecombine);
