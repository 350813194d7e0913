/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The rangecast-stats messages of all elements: what they count, and when they come. striprender's:
 * striprenderflow. */
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <pthread.h>
#include <utility>

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

  [[nodiscard]] guint64 count (const char *field) const
  {
    guint64 value = 0;
    fail_unless (gst_structure_get_uint64 (structure, field, &value), "no %s", field);
    return value;
  }
  [[nodiscard]] gint64 time (const char *field) const
  {
    gint64 value = 0;
    fail_unless (gst_structure_get_int64 (structure, field, &value), "no %s", field);
    return value;
  }
  [[nodiscard]] double rate (const char *field) const
  {
    double value = 0;
    fail_unless (gst_structure_get_double (structure, field, &value), "no %s", field);
    return value;
  }
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
    bytes += gst_buffer_get_size (coded);
    gst_buffer_unref (coded);
  }
  const auto all = enc.end ();
  fail_unless_equals_int (all.size (), 1);
  fail_unless_cmp (all[0].text ("element"), ==, "neighbourcodeenc");
  fail_unless_cmp (all[0].views (), ==, "0 1 ");
  fail_unless_equals_uint64 (all[0].count ("frames"), 3);
  fail_unless_equals_uint64 (all[0].count ("points"), points);
  fail_unless_equals_uint64 (all[0].count ("bytes"), bytes);
  fail_unless_cmp (std::abs (all[0].rate ("points-per-frame") - double (points) / 3), <, 0.5);
  const double seconds = double (all[0].count ("interval")) * 1e-9;
  fail_unless_cmp (seconds, >, 0);
  fail_unless_cmp (std::abs (all[0].rate ("fps") * seconds - 3), <, 1e-6);
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

/* A rangemux of two views. */
struct Mux {
  Rig rig = ring_rig (2, 32, 24);
  GstHarness *in[2];
  Watched out;

  explicit Mux (const char *properties) : out (make (properties))
  {
    for (int i = 0; i < 2; i++) {
      in[i] = gst_harness_new_with_element (out.h->element, "sink_%u", nullptr);
      gst_harness_set_live (in[i], FALSE);
      gst_harness_set_src_caps (in[i], range_caps (one (i)));
    }
    gst_harness_play (out.h);
  }
  ~Mux ()
  {
    for (GstHarness *h : in)
      gst_harness_teardown (h);
  }
  static GstHarness *make (const char *properties)
  {
    GstElement *element =
        gst_parse_launch ((std::string ("rangemux ") + properties).c_str (), nullptr);
    GstHarness *h = gst_harness_new_with_element (element, nullptr, "src");
    gst_object_unref (element);
    return h;
  }
  [[nodiscard]] Rig one (int view) const
  {
    Rig single;
    single.views = {rig.views[view]};
    return single;
  }
  void push (int view, GstClockTime time)
  {
    fail_unless_equals_int (
        gst_harness_push (in[view], make_frame_set (one (view), time)), GST_FLOW_OK);
  }
};

GST_START_TEST (test_mux_tells_of_each_stream_what_came_and_what_was_missed)
{
  Mux mux (kAtTheEnd);
  for (int i = 0; i < 4; i++) {
    if (i != 2) /* first: a pad of stream 0 takes no second one while it waits for stream 1 */
      mux.push (1, i * kFrame);
    mux.push (0, i * kFrame);
  }
  for (GstHarness *h : mux.in)
    gst_harness_push_event (h, gst_event_new_eos ());
  const Stats whole = mux.out.wait (), sink_0 = mux.out.wait (), sink_1 = mux.out.wait ();
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
}
GST_END_TEST;

GST_START_TEST (test_demux_counts_frame_sets_and_the_views_that_they_lack)
{
  GstElement *element =
      gst_parse_launch ((std::string ("rangedemux") + kAtTheEnd).c_str (), nullptr);
  Watched demux (gst_harness_new_with_element (element, "sink", nullptr));
  gst_object_unref (element);
  const Rig rig = ring_rig (3, 64, 48);
  gst_harness_set_src_caps (demux.h, range_caps (rig));
  gst_harness_play (demux.h);
  gst_harness_push (demux.h, make_frame_set (rig)); /* to nobody: it is counted all the same */
  gst_harness_push (demux.h, make_frame_set ({{rig.views[1]}}, kFrame));
  gst_harness_push_event (demux.h, gst_event_new_eos ()); /* nobody takes it either */
  const auto all = demux.now ();
  fail_unless_equals_int (all.size (), 1);
  fail_unless_cmp (all[0].text ("element"), ==, "rangedemux");
  fail_unless_cmp (all[0].views (), ==, "0 1 2 ");
  fail_unless_equals_uint64 (all[0].count ("frames"), 2);
  fail_unless_equals_uint64 (all[0].count ("lost"), 2);
}
GST_END_TEST;

GST_START_TEST (test_stereodepth_counts_pairs_and_pictures_without_partner)
{
  GstElement *element = gst_parse_launch (
      (std::string ("stereodepth focal-length=64 baseline=0.1 near=0.3 far=1.5") + kAtTheEnd)
          .c_str (),
      nullptr);
  GstHarness *left = gst_harness_new_with_element (element, "left", "src");
  GstHarness *right = gst_harness_new_with_element (element, "right", nullptr);
  gst_object_unref (element);
  Watched depth (left);
  for (GstHarness *h : {left, right}) {
    gst_harness_set_live (h, FALSE);
    gst_harness_set_src_caps_str (h, "video/x-raw,format=GRAY8,width=64,height=48,framerate=30/1");
  }
  const auto push = [] (GstHarness *h, GstClockTime time) {
    GstBuffer *picture = gst_buffer_new_allocate (nullptr, 64 * 48, nullptr);
    gst_buffer_memset (picture, 0, 100, 64 * 48);
    GST_BUFFER_PTS (picture) = time;
    fail_unless_equals_int (gst_harness_push (h, picture), GST_FLOW_OK);
  };
  push (left, 0);
  push (right, 0);
  push (left, kFrame); /* its partner is lost */
  push (right, 2 * kFrame);
  push (left, 2 * kFrame);
  gst_harness_push_event (left, gst_event_new_eos ());
  gst_harness_push_event (right, gst_event_new_eos ());
  const Stats stats = depth.wait ();
  fail_unless_equals_uint64 (stats.count ("frames"), 2);
  fail_unless_equals_uint64 (stats.count ("lost"), 1);
  fail_unless_equals_uint64 (stats.count ("late"), 0);
  fail_unless_cmp (stats.views (), ==, "0 ");
  gst_harness_teardown (right);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_from_capture_to_now_on_the_elements_clock)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc (std::string ("neighbourcodeenc") + kAtTheEnd, range_caps (rig));
  gst_harness_use_testclock (enc.h);
  gst_harness_set_time (enc.h, 5 * GST_SECOND);
  for (const GstClockTime age : {10, 20, 30, 40, 50}) /* milliseconds */
    gst_buffer_unref (gst_harness_push_and_pull (
        enc.h, make_frame_set (rig, 5 * GST_SECOND - age * GST_MSECOND)));
  const auto all = enc.end ();
  fail_unless_equals_int64 (all[0].time ("latency-p50"), 30 * GST_MSECOND);
  fail_unless_equals_int64 (all[0].time ("latency-p99"), 50 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_clocks_that_have_nothing_to_do_with_each_other_give_no_latency)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc (std::string ("neighbourcodeenc") + kAtTheEnd, range_caps (rig));
  gst_harness_use_testclock (enc.h);
  gst_harness_set_time (enc.h, 3600 * GST_SECOND);
  gst_buffer_unref (gst_harness_push_and_pull (enc.h, make_frame_set (rig, kFrame)));
  const auto all = enc.end ();
  fail_unless_equals_uint64 (all[0].count ("frames"), 1);
  fail_if (all[0].has ("latency-p50"));
}
GST_END_TEST;

GST_START_TEST (test_stream_that_stalls_is_told_of_with_zero_fps)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc ("neighbourcodeenc stats-interval=20", range_caps (rig));
  gst_buffer_unref (gst_harness_push_and_pull (enc.h, make_frame_set (rig)));
  while (true) { /* the one that tells of the frame may come after one or two without */
    const Stats stats = enc.wait ();
    if (stats.count ("frames") == 1 && stats.rate ("fps") == 0)
      break;
  }
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

GST_START_TEST (test_can_be_switched_while_playing)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc ("neighbourcodeenc", range_caps (rig));
  g_object_set (enc.h->element, "stats-interval", 10u, nullptr);
  enc.wait ();
  enc.wait ();
  guint interval = 0;
  g_object_get (enc.h->element, "stats-interval", &interval, nullptr);
  fail_unless_equals_int (interval, 10);
  g_object_set (enc.h->element, "stats-interval", 0u, nullptr);
  fail_unless (gst_harness_push_event (enc.h, gst_event_new_eos ()));
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

GST_START_TEST (test_flush_changes_no_count)
{
  const Rig rig = ring_rig (1, 64, 48);
  Watched enc (std::string ("neighbourcodeenc") + kAtTheEnd, range_caps (rig));
  gst_buffer_unref (gst_harness_push_and_pull (enc.h, make_frame_set (rig)));
  gst_harness_push_event (enc.h, gst_event_new_flush_start ());
  gst_harness_push_event (enc.h, gst_event_new_flush_stop (TRUE));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (enc.h, gst_event_new_segment (&segment));
  gst_buffer_unref (gst_harness_push_and_pull (enc.h, make_frame_set (rig, kFrame)));
  fail_unless_equals_uint64 (enc.end ()[0].count ("frames"), 2);
}
GST_END_TEST;

/* The timer's thread may be about to post while the element goes. */
GST_START_TEST (test_elements_that_come_and_go_while_the_timer_runs_are_no_fault)
{
  for (int i = 0; i < 200; i++) {
    GstElement *element = gst_element_factory_make ("neighbourcodedec", nullptr);
    g_object_set (element, "stats-interval", 1u, nullptr);
    gst_element_set_state (element, GST_STATE_PLAYING);
    if (i % 8 == 0)
      g_usleep (1500);
    gst_element_set_state (element, i % 2 ? GST_STATE_NULL : GST_STATE_READY);
    gst_element_set_state (element, GST_STATE_NULL);
    gst_object_unref (element);
  }
}
GST_END_TEST;

static std::string
thread_name ()
{
  char name[16] = "";
  pthread_getname_np (pthread_self (), name, sizeof name);
  return name;
}

/* An element that goes while its message is handled: the timer's is the last reference. */
struct LastReference {
  std::mutex lock;
  std::condition_variable changed;
  bool posted = false, released = false;
  std::string poster, finaliser; /* names of threads */

  void wait_for (const bool &what)
  {
    std::unique_lock guard (lock);
    fail_unless (changed.wait_for (guard, std::chrono::seconds (20), [&] { return what; }));
  }
  void note (bool &what)
  {
    std::lock_guard guard (lock);
    what = true;
    changed.notify_all ();
  }
};

static GstBusSyncReply
wait_until_released (GstBus *, GstMessage *message, gpointer data)
{
  auto &last = *static_cast<LastReference *> (data);
  if (gst_message_has_name (message, "rangecast-stats") && !last.posted) {
    last.poster = thread_name ();
    last.note (last.posted);
    last.wait_for (last.released);
  }
  gst_message_unref (message); /* it has a reference to the element */
  return GST_BUS_DROP;
}

GST_START_TEST (test_the_thread_of_all_timers_neither_posts_nor_has_the_last_reference)
{
  LastReference last;
  GstBus *bus = gst_bus_new ();
  gst_bus_set_sync_handler (bus, wait_until_released, &last, nullptr);
  GstElement *element = gst_element_factory_make ("neighbourcodedec", nullptr);
  bool finalised = false;
  const std::pair<LastReference *, bool *> noted (&last, &finalised);
  const auto note_end = [] (gpointer data, GObject *) {
    const auto &[to, end] = *static_cast<decltype (noted) *> (data);
    to->finaliser = thread_name ();
    to->note (*end);
  };
  g_object_weak_ref (
      G_OBJECT (element), note_end, const_cast<void *> (static_cast<const void *> (&noted)));
  gst_element_set_bus (element, bus);
  g_object_set (element, "stats-interval", 1u, nullptr);
  gst_element_set_state (element, GST_STATE_PLAYING);
  last.wait_for (last.posted);
  gst_element_set_state (element, GST_STATE_NULL);
  gst_object_unref (element);
  last.note (last.released);
  last.wait_for (finalised);
  fail_unless (!last.poster.starts_with ("GstSystemClock"), last.poster.c_str ());
  fail_unless (!last.finaliser.starts_with ("GstSystemClock"), last.finaliser.c_str ());
  gst_object_unref (bus);
}
GST_END_TEST;

GST_START_TEST (test_all_elements_have_the_property)
{
  for (const char *name : {"stereodepth", "roiextract", "neighbourcodeenc", "neighbourcodedec",
           "rtpneighbourcodepay", "rtpneighbourcodedepay", "rangemux", "rangedemux",
           "cylinderfilter", "rangealign", "striprender", "stereocamsrc"}) {
    GstElement *element = gst_element_factory_make (name, nullptr);
    if (!element && g_str_equal (name, "stereocamsrc"))
      continue; /* built without Aravis */
    fail_unless (element != nullptr, "%s", name);
    guint interval = 0;
    g_object_get (element, "stats-interval", &interval, nullptr);
    fail_unless_equals_int (interval, 0);
    g_object_set (element, "stats-interval", 250u, nullptr);
    g_object_get (element, "stats-interval", &interval, nullptr);
    fail_unless_equals_int (interval, 250);
    gst_object_unref (element);
  }
}
GST_END_TEST;

static Suite *
statistics_suite ()
{
  Suite *suite = suite_create ("statistics");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 180);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_encoder_counts_what_went_in_and_out);
  tcase_add_test (tc, test_decoder_counts_points_and_lost_pixels);
  tcase_add_test (tc, test_packets_are_counted_on_both_sides_and_the_lost_ones);
  tcase_add_test (tc, test_filters_count_the_points_that_they_leave);
  tcase_add_test (tc, test_mux_tells_of_each_stream_what_came_and_what_was_missed);
  tcase_add_test (tc, test_demux_counts_frame_sets_and_the_views_that_they_lack);
  tcase_add_test (tc, test_stereodepth_counts_pairs_and_pictures_without_partner);
  tcase_add_test (tc, test_latency_is_from_capture_to_now_on_the_elements_clock);
  tcase_add_test (tc, test_clocks_that_have_nothing_to_do_with_each_other_give_no_latency);
  tcase_add_test (tc, test_stream_that_stalls_is_told_of_with_zero_fps);
  tcase_add_test (tc, test_nothing_is_posted_when_off_or_paused);
  tcase_add_test (tc, test_can_be_switched_while_playing);
  tcase_add_test (tc, test_counters_start_over_with_each_start);
  tcase_add_test (tc, test_flush_changes_no_count);
  tcase_add_test (tc, test_elements_that_come_and_go_while_the_timer_runs_are_no_fault);
  tcase_add_test (tc, test_the_thread_of_all_timers_neither_posts_nor_has_the_last_reference);
  tcase_add_test (tc, test_all_elements_have_the_property);
  return suite;
}

GST_CHECK_MAIN (statistics);
