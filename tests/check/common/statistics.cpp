/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The rangecast-stats messages of all elements: what they count, and when they come. striprender's:
 * striprenderlive. */
#include "../coded-check.hpp"

#include <map>
#include <rangecast/geometry/point_cloud.hpp>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 30;

/* No message comes by time within a test; only the one of the end. */
static constexpr const char *kAtTheEnd = " stats-interval=3600000 ";

struct Stats {
  GstStructure *structure = nullptr;

  explicit Stats (const GstStructure *s) : structure (gst_structure_copy (s)) {}
  Stats (const Stats &other) : Stats (other.structure) {}
  Stats &operator= (const Stats &) = delete;
  ~Stats () { gst_structure_free (structure); }

  template <typename T> [[nodiscard]] T get (const char *field) const
  {
    T value = 0;
    constexpr GType type = std::is_same_v<T, double>   ? G_TYPE_DOUBLE
                           : std::is_same_v<T, gint64> ? G_TYPE_INT64
                                                       : G_TYPE_UINT64;
    fail_unless (gst_structure_get (structure, field, type, &value, nullptr), "no %s", field);
    return value;
  }
  [[nodiscard]] guint64 count (const char *field) const { return get<guint64> (field); }
  [[nodiscard]] std::string text (const char *field) const
  {
    const gchar *value = gst_structure_get_string (structure, field);
    return value ? value : "";
  }
  [[nodiscard]] bool has (const char *field) const
  {
    return gst_structure_has_field (structure, field);
  }
  /* "0 1 " */
  [[nodiscard]] std::string views () const
  {
    const GValue *array = gst_structure_get_value (structure, "view-ids");
    std::string ids;
    for (guint i = 0; array && i < gst_value_array_get_size (array); i++)
      ids += std::to_string (g_value_get_int (gst_value_array_get_value (array, i))) + " ";
    return ids;
  }
};

/* An element and the messages that it posts. */
struct Watched {
  GstHarness *h = nullptr;
  GstBus *bus = gst_bus_new ();

  explicit Watched (const std::string &launch, GstCaps *caps) : Watched (harness_of (launch))
  {
    gst_harness_set_src_caps (h, caps);
  }
  explicit Watched (GstHarness *harness) : h (harness) { gst_element_set_bus (h->element, bus); }
  ~Watched ()
  {
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
  }
  /* Those that are there after the end of the stream. */
  std::vector<Stats> end ()
  {
    fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
    return now ();
  }
  std::vector<Stats> now ()
  {
    std::vector<Stats> all;
    while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ELEMENT)) {
      if (gst_message_has_name (message, "rangecast-stats"))
        all.emplace_back (gst_message_get_structure (message));
      gst_message_unref (message);
    }
    return all;
  }
  /* The next one. */
  Stats wait ()
  {
    while (true) {
      GstMessage *message = gst_bus_timed_pop_filtered (bus, 20 * GST_SECOND, GST_MESSAGE_ELEMENT);
      fail_unless (message != nullptr, "no statistics came");
      const GstStructure *s = gst_message_get_structure (message);
      if (gst_structure_has_name (s, "rangecast-stats")) {
        Stats stats (s);
        gst_message_unref (message);
        return stats;
      }
      gst_message_unref (message);
    }
  }
};

static guint64
points_of (GstBuffer *buffer)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
  guint64 points = 0;
  for (const RangeImage &image : frame.views ())
    points += count_points (image);
  return points;
}

GST_START_TEST (test_encoder_counts_what_went_in_and_out)
{
  const Rig rig = ring_rig (2, 64, 48);
  Watched enc (std::string ("neighbourcodeenc") + kAtTheEnd, range_caps (rig));
  guint64 points = 0, bytes = 0;
  for (int i = 0; i < 3; i++) {
    GstBuffer *frame_set = make_frame_set (rig, i * kFrame);
    points += points_of (frame_set);
    GstBuffer *coded = gst_harness_push_and_pull (enc.h, frame_set);
    for (const auto &slice : slices_of (coded))
      bytes += slice.size ();
    gst_buffer_unref (coded);
  }
  const auto all = enc.end ();
  fail_unless_equals_int (all.size (), 1);
  fail_unless_cmp (all[0].text ("element"), ==, "neighbourcodeenc");
  fail_unless_cmp (all[0].views (), ==, "0 1 ");
  fail_unless_equals_uint64 (all[0].count ("frames"), 3);
  fail_unless_equals_uint64 (all[0].count ("points"), points);
  fail_unless_equals_uint64 (all[0].count ("bytes"), bytes);
  fail_unless_cmp (
      std::abs (all[0].get<double> ("points-per-frame") - double (points) / 3), <, 0.5);
  const double seconds = double (all[0].count ("interval")) * 1e-9;
  fail_unless_cmp (seconds, >, 0);
  fail_unless_cmp (std::abs (all[0].get<double> ("fps") * seconds - 3), <, 1e-6);
  fail_unless_cmp (
      std::abs (double (all[0].count ("bitrate")) * seconds - 8 * double (bytes)), <, 8);
}
GST_END_TEST;

GST_START_TEST (test_decoder_counts_points_and_lost_pixels)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched dec (std::string ("neighbourcodedec") + kAtTheEnd, coded_caps (rig));
  auto units = encoded_units (rig, make_frame_set (rig), "max-slice-size=512");
  ck_assert_uint_gt (units.size (), 2);
  const auto push = [&] (GstClockTime time) {
    GstBuffer *decoded = gst_harness_push_and_pull (dec.h, buffer_of (units, time));
    const guint64 points = points_of (decoded);
    gst_buffer_unref (decoded);
    return points;
  };
  guint64 points = push (0);
  units.erase (units.begin () + 1);
  points += push (kFrame);
  const auto all = dec.end ();
  fail_unless_equals_int (all.size (), 1);
  fail_unless_equals_uint64 (all[0].count ("frames"), 2);
  fail_unless_equals_uint64 (all[0].count ("points"), points);
  GstStructure *own = nullptr;
  guint64 missing = 0;
  g_object_get (dec.h->element, "stats", &own, nullptr);
  gst_structure_get_uint64 (own, "missing-pixels", &missing);
  gst_structure_free (own);
  ck_assert_uint_gt (missing, 0);
  fail_unless_equals_uint64 (all[0].count ("lost"), missing);
}
GST_END_TEST;

GST_START_TEST (test_packets_are_counted_on_both_sides_and_the_lost_ones)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc ("neighbourcodeenc profile=plain max-slice-size=400", range_caps (rig));
  Watched pay (std::string ("rtpneighbourcodepay mtu=600") + kAtTheEnd, coded_caps (rig));
  for (int i = 0; i < 3; i++)
    gst_harness_push (pay.h, gst_harness_push_and_pull (enc.h, make_frame_set (rig, i * kFrame)));
  const auto packets = pull_all (pay.h);
  guint64 bytes = 0;
  for (GstBuffer *packet : packets)
    bytes += gst_buffer_get_size (packet);
  const auto sent = pay.end ();
  fail_unless_equals_int (sent.size (), 1);
  fail_unless_equals_uint64 (sent[0].count ("frames"), 3);
  fail_unless_equals_uint64 (sent[0].count ("packets"), packets.size ());
  fail_unless_equals_uint64 (sent[0].count ("bytes"), bytes);

  Watched depay (
      std::string ("rtpneighbourcodedepay") + kAtTheEnd, gst_pad_get_current_caps (pay.h->sinkpad));
  ck_assert_uint_gt (packets.size (), 6);
  for (std::size_t i = 0; i < packets.size (); i++)
    if (i == 2 || i == 3)
      gst_buffer_unref (packets[i]);
    else
      gst_harness_push (depay.h, packets[i]);
  const auto received = depay.end ();
  fail_unless_equals_int (received.size (), 1);
  fail_unless_equals_uint64 (received[0].count ("frames"), 3);
  fail_unless_equals_uint64 (received[0].count ("packets"), packets.size () - 2);
  fail_unless_equals_uint64 (received[0].count ("lost"), 2);
  guint64 out = 0;
  for (GstBuffer *buffer : pull_all (depay.h)) {
    out += gst_buffer_get_size (buffer);
    gst_buffer_unref (buffer);
  }
  fail_unless_equals_uint64 (received[0].count ("bytes"), out);
}
GST_END_TEST;

GST_START_TEST (test_filters_count_the_points_that_they_leave)
{
  const Rig rig = ring_rig (2, 64, 48);
  for (const char *name : {"cylinderfilter", "roiextract"}) {
    Watched filter (std::string (name) + kAtTheEnd, range_caps (rig));
    guint64 points = 0;
    for (int i = 0; i < 3; i++) {
      GstBuffer *out = gst_harness_push_and_pull (filter.h, make_frame_set (rig, i * kFrame));
      points += points_of (out);
      gst_buffer_unref (out);
    }
    const auto all = filter.end ();
    fail_unless_equals_int (all.size (), 1);
    fail_unless_equals_uint64 (all[0].count ("frames"), 3);
    fail_unless_equals_uint64 (all[0].count ("points"), points);
    fail_unless_cmp (all[0].views (), ==, "0 1 ");
  }
}
GST_END_TEST;

GST_START_TEST (test_mux_reports_for_each_stream_what_came_and_what_was_missed)
{
  const Rig rig = ring_rig (2, 32, 24);
  GstElement *element = gst_parse_launch ((std::string ("rangemux") + kAtTheEnd).c_str (), nullptr);
  Watched mux (gst_harness_new_with_element (element, nullptr, "src"));
  gst_object_unref (element);
  GstHarness *in[2];
  for (int i = 0; i < 2; i++) {
    in[i] = gst_harness_new_with_element (mux.h->element, "sink_%u", nullptr);
    gst_harness_set_live (in[i], FALSE);
    gst_harness_set_src_caps (in[i], range_caps ({{rig.views[i]}}));
  }
  gst_harness_play (mux.h);
  for (int i = 0; i < 4; i++)
    for (const int view : {1, 0}) /* view 0 of a frame set without view 1 makes its pad wait */
      if (i != 2 || view == 0)
        fail_unless_equals_int (
            gst_harness_push (in[view], make_frame_set ({{rig.views[view]}}, i * kFrame)),
            GST_FLOW_OK);
  for (GstHarness *h : in)
    gst_harness_push_event (h, gst_event_new_eos ());
  const Stats whole = mux.wait (), sink_0 = mux.wait (), sink_1 = mux.wait ();
  fail_if (whole.has ("pad"));
  fail_unless_equals_uint64 (whole.count ("frames"), 4);
  fail_unless_equals_uint64 (whole.count ("lost"), 1); /* that frame set lacked a view */
  fail_unless_cmp (whole.views (), ==, "0 1 ");
  fail_unless_cmp (sink_0.text ("pad"), ==, "sink_0");
  fail_unless_cmp (sink_0.views (), ==, "0 ");
  fail_unless_equals_uint64 (sink_0.count ("frames"), 4);
  fail_unless_equals_uint64 (sink_0.count ("lost"), 0);
  fail_unless_cmp (sink_1.text ("pad"), ==, "sink_1");
  fail_unless_equals_uint64 (sink_1.count ("frames"), 3);
  fail_unless_equals_uint64 (sink_1.count ("lost"), 1);
  fail_unless_equals_uint64 (sink_1.count ("late"), 0);
  for (GstHarness *h : in)
    gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_from_capture_to_now_unless_the_clocks_are_unrelated)
{
  const Rig rig = ring_rig (1, 64, 48);
  for (const GstClockTime now : {5 * GST_SECOND, 3600 * GST_SECOND}) {
    Watched enc (std::string ("neighbourcodeenc") + kAtTheEnd, range_caps (rig));
    gst_harness_use_testclock (enc.h);
    gst_harness_set_time (enc.h, now);
    for (const GstClockTime age : {10, 20, 30, 40, 50}) /* milliseconds */
      gst_buffer_unref (gst_harness_push_and_pull (
          enc.h, make_frame_set (rig, 5 * GST_SECOND - age * GST_MSECOND)));
    const auto all = enc.end ();
    if (now == 5 * GST_SECOND) {
      fail_unless_equals_int64 (all[0].get<gint64> ("latency-p50"), 30 * GST_MSECOND);
      fail_unless_equals_int64 (all[0].get<gint64> ("latency-p99"), 50 * GST_MSECOND);
    } else {
      fail_if (all[0].has ("latency-p50"));
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_stream_that_stalls_is_reported_with_zero_fps_until_switched_off)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc ("neighbourcodeenc", range_caps (rig));
  g_object_set (enc.h->element, "stats-interval", 20u, nullptr);
  gst_buffer_unref (gst_harness_push_and_pull (enc.h, make_frame_set (rig)));
  while (true) { /* the one that counts the frame may come after one or two without */
    const Stats stats = enc.wait ();
    if (stats.count ("frames") == 1 && stats.get<double> ("fps") == 0)
      break;
  }
  g_object_set (enc.h->element, "stats-interval", 0u, nullptr);
  fail_unless (gst_harness_push_event (enc.h, gst_event_new_eos ()));
}
GST_END_TEST;

GST_START_TEST (test_nothing_is_posted_when_off_or_paused)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched off ("neighbourcodeenc", range_caps (rig));
  Watched paused ("neighbourcodeenc stats-interval=5", range_caps (rig));
  Watched on ("neighbourcodeenc stats-interval=20", range_caps (rig));
  gst_element_set_state (paused.h->element, GST_STATE_PAUSED);
  on.wait (); /* what was on its way came */
  paused.now ();
  gst_buffer_unref (gst_harness_push_and_pull (off.h, make_frame_set (rig)));
  for (int i = 0; i < 3; i++) /* time passes for all */
    on.wait ();
  fail_unless_equals_int (paused.now ().size (), 0);
  fail_unless_equals_int (off.end ().size (), 0);
}
GST_END_TEST;

/* What each element's last message before the end of the stream says. */
static std::map<std::string, guint64>
frames_at_the_end (GstElement *pipeline)
{
  std::map<std::string, guint64> frames;
  GstBus *bus = gst_element_get_bus (pipeline);
  for (bool ended = false; !ended;) {
    GstMessage *message = gst_bus_timed_pop_filtered (bus, 60 * GST_SECOND,
        GstMessageType (GST_MESSAGE_ELEMENT | GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
    fail_unless (message);
    ck_assert_int_ne (GST_MESSAGE_TYPE (message), GST_MESSAGE_ERROR);
    ended = GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS;
    if (gst_message_has_name (message, "rangecast-stats"))
      gst_structure_get_uint64 (
          gst_message_get_structure (message), "frames", &frames[GST_MESSAGE_SRC_NAME (message)]);
    gst_message_unref (message);
  }
  gst_object_unref (bus);
  return frames;
}

GST_START_TEST (test_counters_start_over_with_each_start)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc name=source view-id=0 ! video/x-range,width=64,height=48 ! roiextract "
      "name=roi ! neighbourcodeenc name=enc ! rtpneighbourcodepay name=pay ! "
      "rtpneighbourcodedepay name=depay ! neighbourcodedec name=dec ! rangealign name=align ! "
      "cylinderfilter name=filter ! rangemux name=mux ! fakesink",
      nullptr);
  fail_unless (pipeline != nullptr);
  GstElement *source = gst_bin_get_by_name (GST_BIN (pipeline), "source");
  for (const char *name : {"roi", "enc", "pay", "depay", "dec", "align", "filter", "mux"}) {
    GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), name);
    g_object_set (element, "stats-interval", 3600000u, nullptr);
    gst_object_unref (element);
  }
  for (const guint64 expected : {3, 2}) {
    g_object_set (source, "num-buffers", int (expected), nullptr);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    auto frames = frames_at_the_end (pipeline);
    for (const char *name : {"roi", "enc", "pay", "depay", "dec", "align", "filter", "mux"})
      fail_unless (frames[name] == expected, "%s: %d", name, int (frames[name]));
    gst_element_set_state (pipeline, GST_STATE_READY);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (source);
  gst_object_unref (pipeline);
}
GST_END_TEST;

static Suite *
statistics_suite ()
{
  Suite *suite = suite_create ("statistics");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_encoder_counts_what_went_in_and_out);
  tcase_add_test (tc, test_decoder_counts_points_and_lost_pixels);
  tcase_add_test (tc, test_packets_are_counted_on_both_sides_and_the_lost_ones);
  tcase_add_test (tc, test_filters_count_the_points_that_they_leave);
  tcase_add_test (tc, test_mux_reports_for_each_stream_what_came_and_what_was_missed);
  tcase_add_test (tc, test_latency_is_from_capture_to_now_unless_the_clocks_are_unrelated);
  tcase_add_test (tc, test_stream_that_stalls_is_reported_with_zero_fps_until_switched_off);
  tcase_add_test (tc, test_nothing_is_posted_when_off_or_paused);
  tcase_add_test (tc, test_counters_start_over_with_each_start);
  return suite;
}

GST_CHECK_MAIN (statistics);
