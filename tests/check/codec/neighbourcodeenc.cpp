/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../coded-check.hpp"

#include <gst/video/video.h>

#include <algorithm>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr const char *kSliceCaps = "video/x-neighbour-code,alignment=slice";

static GstHarness *
encoder (const Rig &rig, const char *properties = "", const char *sink_caps = nullptr)
{
  GstHarness *h = harness_of (std::string ("neighbourcodeenc ") + properties);
  if (sink_caps)
    gst_harness_set_sink_caps_str (h, sink_caps);
  gst_harness_set_src_caps (h, range_caps (rig));
  return h;
}

static std::vector<std::vector<guint8>>
push_and_pull_units (GstHarness *h, GstBuffer *frame_set)
{
  GstBuffer *coded = gst_harness_push_and_pull (h, frame_set);
  const auto units = units_of (bytes_of (coded));
  gst_buffer_unref (coded);
  return units;
}

GST_START_TEST (test_states_change_twice_and_frames_count_from_0_again)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  for (int round = 0; round < 2; round++) {
    for (guint32 i = 0; i < 3; i++) {
      const auto units = push_and_pull_units (h, make_frame_set (rig, i));
      fail_unless_equals_int (header_of (units[0]).frame_number, i);
    }
    for (const GstState state : {GST_STATE_READY, GST_STATE_READY, GST_STATE_NULL, GST_STATE_NULL})
      ck_assert_int_eq (gst_element_set_state (h->element, state), GST_STATE_CHANGE_SUCCESS);
    gst_harness_play (h);
    gst_harness_set_src_caps (h, range_caps (rig));
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Writes 'b' for each buffer and 'e' for EOS, in the order in which they leave. */
static GstPadProbeReturn
note_order (GstPad *, GstPadProbeInfo *info, gpointer data)
{
  auto &order = *static_cast<std::string *> (data);
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER)
    order += 'b';
  else if (info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST)
    order.append (gst_buffer_list_length (GST_PAD_PROBE_INFO_BUFFER_LIST (info)), 'b');
  else if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_EOS)
    order += 'e';
  return GST_PAD_PROBE_OK;
}

GST_START_TEST (test_eos_comes_out_after_the_last_frame_set)
{
  for (const char *caps : {"video/x-neighbour-code,alignment=access-unit", kSliceCaps}) {
    const Rig rig = ring_rig (1);
    GstHarness *h = encoder (rig, "", caps);
    std::string order;
    gst_pad_add_probe (h->sinkpad, GST_PAD_PROBE_TYPE_DATA_DOWNSTREAM, note_order, &order, nullptr);
    gst_harness_push (h, make_frame_set (rig));
    fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
    auto buffers = pull_all (h);
    fail_unless (!buffers.empty ());
    const std::string expected = std::string (buffers.size (), 'b') + 'e';
    fail_unless_equals_string (order.c_str (), expected.c_str ());
    unref_all (buffers);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_goes_on_after_a_flush)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  push_and_pull_units (h, make_frame_set (rig));
  flush (h);
  fail_unless (!push_and_pull_units (h, make_frame_set (rig)).empty ());
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_gap_goes_by_in_order)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  push_and_pull_units (h, make_frame_set (rig, 0));
  fail_unless (!pulls_event (h, GST_EVENT_GAP));
  fail_unless (gst_harness_push_event (h, gst_event_new_gap (GST_SECOND, GST_SECOND)));
  fail_unless (pulls_event (h, GST_EVENT_GAP));
  push_and_pull_units (h, make_frame_set (rig, 2 * GST_SECOND));
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_caps_in_mid_stream_give_slices_of_the_new_rig)
{
  const Rig small = ring_rig (1, 64, 48), large = ring_rig (3, 128, 96);
  GstHarness *h = encoder (small);
  for (const Rig *rig : {&small, &large, &small}) {
    gst_harness_set_src_caps (h, range_caps (*rig));
    const auto units = push_and_pull_units (h, make_frame_set (*rig));
    fail_unless_equals_int (header_of (units[0]).roi.width, rig->views[0].width);
    fail_unless_equals_int (header_of (units.back ()).view_id, int (rig->views.size ()) - 1);
    GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
    gstrange::RangeInfo info;
    fail_unless_ok (gstrange::parse_caps (caps, info));
    fail_unless_cmp (encode_rig (info.rig), ==, encode_rig (*rig));
    gst_caps_unref (caps);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The same frame set with space behind its rows and between its planes. */
static GstBuffer *
with_padded_strides (GstBuffer *frame_set)
{
  constexpr guint kPad = 52;
  GstBuffer *padded = gst_buffer_new ();
  gst_buffer_copy_into (padded, frame_set, GST_BUFFER_COPY_METADATA, 0, -1);
  while (GstRangeMeta *meta = gst_buffer_get_range_meta (padded, 0))
    gst_buffer_remove_meta (padded, &meta->meta);
  const GstRangeMeta *old = gst_buffer_get_range_meta (frame_set, 0);
  const guint depth_stride = 2 * old->width + kPad, colour_stride = 4 * old->width + kPad;
  const gsize size = gsize (depth_stride + colour_stride) * old->height + kPad;
  gst_buffer_append_memory (padded, gst_allocator_alloc (nullptr, size, nullptr));
  gst_buffer_memset (padded, 0, 0x77, size);
  auto meta =
      reinterpret_cast<GstRangeMeta *> (gst_buffer_add_meta (padded, GST_RANGE_META_INFO, nullptr));
  const GstMeta base = meta->meta;
  *meta = *old;
  meta->meta = base;
  meta->depth_offset = 0;
  meta->depth_stride = depth_stride;
  meta->colour_offset = gsize{depth_stride} * old->height + kPad;
  meta->colour_stride = colour_stride;
  {
    gstrange::RangeFrameMap from (frame_set, GST_MAP_READ), to (padded, GST_MAP_WRITE);
    fail_unless_ok (from.status ());
    fail_unless_ok (to.status ());
    fill_from (from.views ()[0], to.views ()[0]);
  }
  gst_buffer_unref (frame_set);
  return padded;
}

GST_START_TEST (test_padded_strides_code_to_the_same)
{
  const Rig rig = ring_rig (1);
  const auto plain = encoded_units (rig, make_frame_set (rig));
  fail_unless_cmp (encoded_units (rig, with_padded_strides (make_frame_set (rig))), ==, plain);
}
GST_END_TEST;

/* Depth units; pixels may neither come nor go. */
static int
worst_depth_error (GstBuffer *sent, GstBuffer *got)
{
  gstrange::RangeFrameMap a (sent, GST_MAP_READ), b (got, GST_MAP_READ);
  fail_unless_equals_int (a.views ().size (), b.views ().size ());
  int worst = 0;
  for (std::size_t i = 0; i < a.views ().size (); i++) {
    const RangeImage &x = a.views ()[i], &y = b.views ()[i];
    fail_unless_cmp (x.roi, ==, y.roi);
    for (int row = 0; row < x.roi.height; row++)
      for (int column = 0; column < x.roi.width; column++) {
        const int before = x.depth.at (column, row), after = y.depth.at (column, row);
        fail_unless_equals_int (before == 0, after == 0);
        worst = std::max (worst, std::abs (before - after));
      }
  }
  return worst;
}

GST_START_TEST (test_bits_change_with_the_next_frame_set)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "depth-bits=12 colour-bits=8");
  fail_unless_equals_int (
      header_of (push_and_pull_units (h, make_frame_set (rig))[0]).depth_bits, 12);
  double coarse, fine;
  g_object_set (h->element, "depth-bits", 16, "colour-bits", 5, nullptr);
  g_object_get (h->element, "max-depth-error", &coarse, nullptr);
  const SliceHeader header = header_of (push_and_pull_units (h, make_frame_set (rig))[0]);
  g_object_get (h->element, "max-depth-error", &fine, nullptr);
  fail_unless_equals_int (header.depth_bits, 16);
  fail_unless_equals_int (header.colour_bits, 5);
  fail_unless_cmp (fine, <, coarse);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_depth_scale_changes_with_the_next_frame_set_and_slices_say_it)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "depth-scale=inverse");
  for (const char *scale : {"inverse", "linear", "inverse"}) {
    gst_util_set_object_arg (G_OBJECT (h->element), "depth-scale", scale);
    for (const auto &unit : push_and_pull_units (h, make_frame_set (rig)))
      fail_unless_equals_int (header_of (unit).inverse_depth, scale[0] == 'i');
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_max_depth_error_is_what_decoded_depths_come_to)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : {"plain", "packed", "entropy"})
    for (const char *scale : {"linear", "inverse"}) {
      GstHarness *h = harness_of (std::string ("neighbourcodeenc depth-bits=9 depth-threshold=2 ") +
                                  "profile=" + profile + " depth-scale=" + scale);
      GstHarness *decoder = harness_of ("neighbourcodedec");
      gst_harness_set_src_caps (h, range_caps (rig));
      gst_harness_set_src_caps (decoder, coded_caps (rig));
      double stated = 1;
      g_object_get (h->element, "max-depth-error", &stated, nullptr);
      fail_unless (stated == 0, "nothing is coded yet");
      GstBuffer *sent = make_frame_set (rig);
      GstBuffer *got =
          gst_harness_push_and_pull (decoder, gst_harness_push_and_pull (h, gst_buffer_ref (sent)));
      g_object_get (h->element, "max-depth-error", &stated, nullptr);
      const double worst = worst_depth_error (sent, got) * rig.views[0].depth_unit_m;
      fail_unless (worst <= stated + 1e-9, "%s %s: %g m of %g", profile, scale, worst, stated);
      fail_unless (worst >= stated / 5, "%s %s: %g m of %g", profile, scale, worst, stated);
      gst_buffer_unref (sent);
      gst_buffer_unref (got);
      gst_harness_teardown (decoder);
      gst_harness_teardown (h);
    }
}
GST_END_TEST;

GST_START_TEST (test_larger_thresholds_give_fewer_bytes_at_once)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "depth-threshold=0 colour-threshold=0");
  gsize last = G_MAXSIZE;
  for (const int threshold : {0, 4, 20, 100}) {
    g_object_set (h->element, "depth-threshold", threshold, "colour-threshold", threshold, nullptr);
    GstBuffer *coded = gst_harness_push_and_pull (h, make_frame_set (rig));
    ck_assert_uint_lt (gst_buffer_get_size (coded), last);
    last = gst_buffer_get_size (coded);
    gst_buffer_unref (coded);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_no_slice_is_longer_than_max_slice_size_also_when_it_changes)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = encoder (rig, "profile=plain depth-threshold=0 colour-threshold=0 depth-bits=16");
  for (const int limit : {256, 1200, 257, 65535, 500}) {
    g_object_set (h->element, "max-slice-size", limit, nullptr);
    gsize longest = 0;
    for (const auto &unit : push_and_pull_units (h, make_frame_set (rig)))
      longest = std::max (longest, unit.size ());
    ck_assert_uint_le (longest, gsize (limit));
    ck_assert_uint_gt (longest, gsize (limit) / 2);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_that_of_upstream)
{
  GstHarness *h = encoder (ring_rig (1));
  gst_harness_set_upstream_latency (h, 40 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (h), 40 * GST_MSECOND);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  const Rig one = ring_rig (1), two = ring_rig (2);
  for (const char *caps : {"video/x-neighbour-code,alignment=access-unit", kSliceCaps}) {
    GstHarness *h = encoder (one, "", caps);
    {
      ErrorCounter errors (h);
      fail_unless_equals_int (gst_harness_push (h, make_frame_set (two)), GST_FLOW_ERROR);
      fail_unless_equals_int (errors.take (), 1);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_caps_without_a_rig_are_an_error)
{
  GstHarness *h = gst_harness_new ("neighbourcodeenc");
  {
    ErrorCounter errors (h);
    gst_harness_set_src_caps_str (
        h, "video/x-range,format=Z16_RGBx,width=320,height=240,framerate=30/1,views=1");
    ck_assert_int_gt (
        errors.take (), 0); /* again with each event: GStreamer repeats refused caps */
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

static GstBuffer *
make_empty_frame_set (const Rig &rig)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (std::size_t i = 0; i < frame.views ().size (); i++)
    frame.crop (i, {});
  return buffer;
}

GST_START_TEST (test_empty_rois_are_one_short_slice_each)
{
  const Rig rig = ring_rig (3);
  const auto units = encoded_units (rig, make_empty_frame_set (rig));
  fail_unless_equals_int (units.size (), 3);
  for (const auto &unit : units)
    fail_unless_equals_int (unit.size (), kSliceHeaderSize);
}
GST_END_TEST;

GST_START_TEST (test_frame_set_without_views_is_an_empty_buffer)
{
  const Rig rig = ring_rig (2);
  for (const char *caps : {"video/x-neighbour-code,alignment=access-unit", kSliceCaps}) {
    GstHarness *h = encoder (rig, "", caps);
    GstBuffer *coded = gst_harness_push_and_pull (h, gst_range_buffer_new (2, 320, 240));
    fail_unless_equals_int (gst_buffer_get_size (coded), 0);
    gst_buffer_unref (coded);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_access_units_are_what_downstream_gets_if_it_does_not_care)
{
  GstHarness *h = encoder (ring_rig (1));
  gst_harness_push (h, make_frame_set (ring_rig (1)));
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  fail_unless_equals_string (
      gst_structure_get_string (gst_caps_get_structure (caps, 0), "alignment"), "access-unit");
  gst_caps_unref (caps);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_slices_come_one_a_buffer_with_the_times_of_their_frame_set)
{
  const Rig rig = ring_rig (2);
  const auto expected = encoded_units (rig, make_frame_set (rig, 42), "");
  GstHarness *h = encoder (rig, "profile=plain", kSliceCaps);
  GstBuffer *input = make_frame_set (rig, 42);
  GST_BUFFER_DURATION (input) = 5;
  fail_unless_equals_int (gst_harness_push (h, input), GST_FLOW_OK);
  auto buffers = pull_all (h);
  fail_unless_equals_int (buffers.size (), expected.size ());
  for (std::size_t i = 0; i < buffers.size (); i++) {
    fail_unless_cmp (bytes_of (buffers[i]), ==, expected[i]);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (buffers[i]), 42);
    fail_unless_equals_uint64 (GST_BUFFER_DURATION (buffers[i]), 5);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (buffers[i]), 42);
    fail_if (GST_BUFFER_FLAG_IS_SET (buffers[i], GST_BUFFER_FLAG_DELTA_UNIT));
  }
  unref_all (buffers);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_only_the_first_slice_has_discont_and_only_the_last_the_marker)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = encoder (rig, "", kSliceCaps);
  for (int frame = 0; frame < 2; frame++) {
    GstBuffer *input = make_frame_set (rig, frame);
    GST_BUFFER_FLAG_SET (input, GST_BUFFER_FLAG_DISCONT);
    gst_harness_push (h, input);
    auto buffers = pull_all (h);
    for (std::size_t i = 0; i < buffers.size (); i++) {
      fail_unless_equals_int (GST_BUFFER_IS_DISCONT (buffers[i]), i == 0);
      fail_unless_equals_int (GST_BUFFER_FLAG_IS_SET (buffers[i], GST_BUFFER_FLAG_MARKER) != 0,
          i + 1 == buffers.size ());
    }
    unref_all (buffers);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

static constexpr GstClockTime kFrame = GST_SECOND / 30;

/* GstForceKeyUnit events that have come out. */
static int
count_announcements (GstHarness *h)
{
  int count = 0;
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    count += gst_video_event_is_force_key_unit (event);
    gst_event_unref (event);
  }
  return count;
}

static void
ask_for_key (GstHarness *h, gboolean all_headers = FALSE)
{
  fail_unless (gst_harness_push_upstream_event (
      h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, all_headers, 1)));
}

/* Codes frame sets that all show the same. @return 'k' for each key one, else 'd' */
static std::string
kinds (GstHarness *h, const Rig &rig, guint from, guint to)
{
  std::string kinds;
  for (guint i = from; i < to; i++) {
    GstBuffer *coded = gst_harness_push_and_pull (h, make_frame_set (rig, i * kFrame));
    kinds += GST_BUFFER_FLAG_IS_SET (coded, GST_BUFFER_FLAG_DELTA_UNIT) ? 'd' : 'k';
    gst_buffer_unref (coded);
  }
  return kinds;
}

GST_START_TEST (test_a_request_waits_until_the_last_key_frame_set_is_old_enough)
{
  const Rig rig = ring_rig (1);
  GstHarness *h =
      encoder (rig, "temporal=true profile=packed min-force-key-unit-interval=90000000");
  fail_unless_cmp (kinds (h, rig, 0, 1), ==, "k");
  ask_for_key (h);
  ask_for_key (h); /* both get the same answer */
  fail_unless_cmp (kinds (h, rig, 1, 5), ==, "ddkd");
  fail_unless_equals_int (count_announcements (h), 1);
  ask_for_key (h);
  fail_unless_cmp (kinds (h, rig, 5, 8), ==, "dkd");
  /* Long enough after it there is nothing to wait for. */
  fail_unless_cmp (kinds (h, rig, 8, 12), ==, "dddd");
  ask_for_key (h);
  fail_unless_cmp (kinds (h, rig, 12, 14), ==, "kd");
  fail_unless_equals_int (count_announcements (h), 2);
  g_object_set (h->element, "min-force-key-unit-interval", guint64{0}, nullptr);
  ask_for_key (h);
  fail_unless_cmp (kinds (h, rig, 14, 16), ==, "kd");
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_requests_for_the_far_future_do_not_keep_others_from_being_heard)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "temporal=true profile=packed");
  fail_unless_cmp (kinds (h, rig, 0, 2), ==, "kd");
  for (guint i = 0; i < 100; i++)
    gst_harness_push_upstream_event (
        h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE - 1, FALSE, i));
  ask_for_key (h);
  fail_unless_cmp (kinds (h, rig, 2, 4), ==, "kd");
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_key_frame_set_that_comes_anyway_answers_those_who_wait)
{
  const Rig rig = ring_rig (1);
  for (const char *anyway : {"temporal=true profile=packed key-interval=100", "temporal=false"}) {
    GstHarness *h =
        encoder (rig, (std::string ("min-force-key-unit-interval=10000000000 ") + anyway).c_str ());
    (void)kinds (h, rig, 0, 1);
    ask_for_key (h);
    fail_unless_equals_int (count_announcements (h), 0);
    (void)kinds (h, rig, 1, 5);
    fail_unless_equals_int (count_announcements (h), 1);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* Rig views of a buffer that has so many bytes in front of its units. */
static int
count_rig_views (GstBuffer *buffer, std::size_t before)
{
  const auto bytes = bytes_of (buffer);
  int count = 0;
  for (const auto &unit : units_of (std::span (bytes).subspan (before)))
    count += (unit[0] & 15) == int (UnitType::kRigView);
  return count;
}

GST_START_TEST (test_all_headers_make_parser_and_payloader_repeat_the_rig_with_the_key_frame_set)
{
  const Rig rig = ring_rig (2, 64, 48);
  const struct {
    const char *launch;
    std::size_t before; /* start code; RTP header */
    std::string all_headers, none;
  } cases[] = {
      {"neighbourcodeparse ! capsfilter caps=video/x-neighbour-code,alignment=byte-stream", 4,
          "20020", "20000"},
      {"rtpneighbourcodepay config-interval=3600 mtu=60000", 12, "20020", "20000"},
      {"rtpneighbourcodepay config-interval=0 mtu=60000", 12, "00000", "00000"},
  };
  for (const auto &c : cases)
    for (const bool all_headers : {true, false}) {
      GstHarness *h = gst_harness_new_parse (
          (std::string ("neighbourcodeenc temporal=true profile=packed ! ") + c.launch).c_str ());
      gst_harness_set_src_caps (h, range_caps (rig));
      std::string rig_views;
      for (guint i = 0; i < 5; i++) {
        if (i == 3)
          ask_for_key (h, all_headers);
        gst_harness_push (h, make_frame_set (rig, i * kFrame));
        auto buffers = pull_all (h);
        fail_if (buffers.empty ());
        int count = 0;
        for (GstBuffer *buffer : buffers)
          count += count_rig_views (buffer, c.before);
        rig_views += std::to_string (count);
        unref_all (buffers);
      }
      const std::string &expected = all_headers ? c.all_headers : c.none;
      fail_unless_equals_string (rig_views.c_str (), expected.c_str ());
      gst_harness_teardown (h);
    }
}
GST_END_TEST;

/* Names of the properties that a controller may set with every buffer. */
static std::string
controllable (GObjectClass *klass)
{
  guint count = 0;
  GParamSpec **specs = g_object_class_list_properties (klass, &count);
  std::vector<std::string> names;
  for (guint i = 0; i < count; i++)
    if (specs[i]->flags & GST_PARAM_CONTROLLABLE) {
      names.emplace_back (specs[i]->name);
      fail_unless (specs[i]->flags & GST_PARAM_MUTABLE_PLAYING, "%s", specs[i]->name);
    }
  g_free (specs);
  std::ranges::sort (names);
  std::string joined;
  for (const std::string &name : names)
    joined += (joined.empty () ? "" : " ") + name;
  return joined;
}

GST_START_TEST (test_a_controller_may_set_what_costs_no_new_tables)
{
  const std::pair<const char *, const char *> expected[] = {
      {"neighbourcodeenc",
          "choice colour-threshold depth-threshold key-interval max-colour-threshold "
          "max-depth-threshold max-slice-size min-bitrate min-force-key-unit-interval "
          "refresh-period "
          "target-bitrate"},
      {"cylinderfilter", ""}, {"rangealign", ""}, {"neighbourcodedec", ""},
      {"neighbourcodeparse", ""}, {"rtpneighbourcodepay", ""}, {"rtpneighbourcodedepay", ""},
      {"rangemux", ""}, {"rangesplit", ""}, {"plyenc", ""}, {"avatartestsrc", ""},
      {"stereodepth", ""}, {"rangecombine", ""}};
  for (const auto &[name, names] : expected) {
    GstElement *element = gst_element_factory_make (name, nullptr);
    if (!element) /* left out of this build */
      continue;
    const std::string found = controllable (G_OBJECT_GET_CLASS (element));
    fail_unless_equals_string (found.c_str (), names);
    gst_object_unref (element);
  }
}
GST_END_TEST;

GST_START_TEST (test_bitrate_counts_the_first_frame_sets)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "temporal=true profile=packed");
  guint64 bytes = 0;
  for (guint i = 0; i < 20; i++) {
    GstBuffer *coded = gst_harness_push_and_pull (h, make_frame_set (rig, i * kFrame));
    bytes += gst_buffer_get_size (coded);
    gst_buffer_unref (coded);
    GstStructure *stats = nullptr;
    guint64 bitrate = 0;
    g_object_get (h->element, "stats", &stats, nullptr);
    fail_unless (gst_structure_get_uint64 (stats, "bitrate", &bitrate));
    gst_structure_free (stats);
    const double expected = 8.0 * double (bytes) * GST_SECOND / double ((i + 1) * kFrame);
    fail_unless (std::abs (double (bitrate) / expected - 1) < 1e-3, "%u: %f", i, expected);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_that_begins_before_the_segment_passes)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  GstBuffer *out = push_before_the_segment (h, rig, GST_SECOND);
  fail_unless (out != nullptr);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
neighbourcodeenc_suite ()
{
  Suite *suite = suite_create ("neighbourcodeenc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_states_change_twice_and_frames_count_from_0_again);
  tcase_add_test (tc, test_eos_comes_out_after_the_last_frame_set);
  tcase_add_test (tc, test_goes_on_after_a_flush);
  tcase_add_test (tc, test_gap_goes_by_in_order);
  tcase_add_test (tc, test_new_caps_in_mid_stream_give_slices_of_the_new_rig);
  tcase_add_test (tc, test_padded_strides_code_to_the_same);
  tcase_add_test (tc, test_bits_change_with_the_next_frame_set);
  tcase_add_test (tc, test_depth_scale_changes_with_the_next_frame_set_and_slices_say_it);
  tcase_add_test (tc, test_max_depth_error_is_what_decoded_depths_come_to);
  tcase_add_test (tc, test_larger_thresholds_give_fewer_bytes_at_once);
  tcase_add_test (tc, test_no_slice_is_longer_than_max_slice_size_also_when_it_changes);
  tcase_add_test (tc, test_latency_is_that_of_upstream);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_caps_without_a_rig_are_an_error);
  tcase_add_test (tc, test_empty_rois_are_one_short_slice_each);
  tcase_add_test (tc, test_frame_set_without_views_is_an_empty_buffer);
  tcase_add_test (tc, test_access_units_are_what_downstream_gets_if_it_does_not_care);
  tcase_add_test (tc, test_slices_come_one_a_buffer_with_the_times_of_their_frame_set);
  tcase_add_test (tc, test_only_the_first_slice_has_discont_and_only_the_last_the_marker);
  tcase_add_test (tc, test_a_request_waits_until_the_last_key_frame_set_is_old_enough);
  tcase_add_test (tc, test_requests_for_the_far_future_do_not_keep_others_from_being_heard);
  tcase_add_test (tc, test_a_key_frame_set_that_comes_anyway_answers_those_who_wait);
  tcase_add_test (
      tc, test_all_headers_make_parser_and_payloader_repeat_the_rig_with_the_key_frame_set);
  tcase_add_test (tc, test_a_controller_may_set_what_costs_no_new_tables);
  tcase_add_test (tc, test_bitrate_counts_the_first_frame_sets);
  tcase_add_test (tc, test_frame_that_begins_before_the_segment_passes);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeenc);
