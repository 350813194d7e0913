/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What passes through striprender, and what comes of it when something goes wrong: gaps, buffers
 * that upstream wants back, pools, failed pushes, memory that ends. */
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <mutex>
#include <new>
#include <utility>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* Memory ends at one piece larger than this: operator new is ours in this program, and in the
 * elements that it loads. All of its forms, so that what one of them gives another one takes. */
static std::atomic<std::size_t> largest_piece = SIZE_MAX;

[[gnu::noinline]] void *
operator new (std::size_t size, const std::nothrow_t &) noexcept
{
  return size > largest_piece ? nullptr : std::malloc (size > 0 ? size : 1);
}

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  void *memory = operator new (size, std::nothrow);
  if (!memory)
    throw std::bad_alloc ();
  return memory;
}

void *
operator new[] (std::size_t size)
{
  return operator new (size);
}

void *
operator new[] (std::size_t size, const std::nothrow_t &) noexcept
{
  return operator new (size, std::nothrow);
}

[[gnu::noinline]] void
operator delete (void *memory) noexcept
{
  std::free (memory);
}

void
operator delete (void *memory, std::size_t) noexcept
{
  operator delete (memory);
}

void
operator delete (void *memory, const std::nothrow_t &) noexcept
{
  operator delete (memory);
}

void
operator delete[] (void *memory) noexcept
{
  operator delete (memory);
}

void
operator delete[] (void *memory, std::size_t) noexcept
{
  operator delete (memory);
}

void
operator delete[] (void *memory, const std::nothrow_t &) noexcept
{
  operator delete (memory);
}

/* ---- gaps ---- */

/* What leaves striprender, in its order: P for a picture, G for a gap, each with its time and
 * duration in ms. The harness gives no order of the two. */
struct Passing {
  std::mutex lock;
  std::string text;

  explicit Passing (GstPad *src)
  {
    const auto types = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM;
    gst_pad_add_probe (src, GstPadProbeType (types), note, this, nullptr);
  }
  std::string take ()
  {
    std::lock_guard guard (lock);
    return std::exchange (text, "");
  }
  void expect (const char *expected)
  {
    const std::string found = take ();
    fail_unless_equals_string (found.c_str (), expected);
  }

private:
  static GstPadProbeReturn note (GstPad *, GstPadProbeInfo *info, gpointer user_data)
  {
    auto self = static_cast<Passing *> (user_data);
    GstClockTime begin = 0, duration = 0;
    const bool picture = GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER;
    if (picture) {
      begin = GST_BUFFER_PTS (GST_PAD_PROBE_INFO_BUFFER (info));
      duration = GST_BUFFER_DURATION (GST_PAD_PROBE_INFO_BUFFER (info));
    } else if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_GAP)
      gst_event_parse_gap (GST_PAD_PROBE_INFO_EVENT (info), &begin, &duration);
    else
      return GST_PAD_PROBE_OK;
    std::lock_guard guard (self->lock);
    self->text += std::string (self->text.empty () ? "" : " ") + (picture ? "P" : "G") +
                  std::to_string (begin / GST_MSECOND) + "+" +
                  std::to_string (duration / GST_MSECOND);
    return GST_PAD_PROBE_OK;
  }
};

static void
push_gap (const Live &live, guint64 begin_ms, guint64 duration_ms)
{
  fail_unless (gst_harness_push_event (
      live.h, gst_event_new_gap (begin_ms * GST_MSECOND, duration_ms * GST_MSECOND)));
}

GST_START_TEST (test_gap_after_hold_time_goes_on)
{
  Live live ("hold-time=0");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  Passing passing (live.src);
  live.push (0);
  live.next ();
  live.next ();
  push_gap (live, 200, 150);
  push_gap (live, 350, 10);
  passing.expect ("P0+100 P100+100 G200+150 G350+10");
  live.push (400 * GST_MSECOND);
  fail_unless_equals_uint64 (live.next ().pts, 400 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_rest_of_a_live_gap_follows_the_pictures_that_fill_it)
{
  Live live ("hold-time=100000000");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  Passing passing (live.src);
  live.push (0);
  live.next ();
  push_gap (live, 200, 300);
  push_gap (live, 500, 100); /* both wait */
  passing.expect ("P0+100");
  live.next ();
  live.next ();
  std::string found;
  for (int tries = 0; tries < 500 && !found.ends_with ("G300+300"); tries++) {
    g_usleep (10000); /* the thread passes it on after the picture */
    const std::string more = passing.take ();
    found += (found.empty () || more.empty () ? "" : " ") + more;
  }
  fail_unless_equals_string (found.c_str (), "P100+100 P200+100 G300+300");
}
GST_END_TEST;

GST_START_TEST (test_gap_comes_between_the_pictures_beside_it)
{
  Live live ("hold-time=0");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  Passing passing (live.src);
  live.push (0);
  push_gap (live, 200, 200);
  live.push (400 * GST_MSECOND);
  push_gap (live, 600, 200);
  live.push (800 * GST_MSECOND);
  for (int i = 0; i < 5; i++)
    live.next ();
  passing.expect ("P0+100 P100+100 G200+200 P400+100 P500+100 G600+200 P800+100");
}
GST_END_TEST;

GST_START_TEST (test_gap_of_a_file_is_filled_as_long_as_hold_time_says_and_the_rest_goes_on)
{
  Live live ("hold-time=200000000");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  gst_harness_set_live (live.h, FALSE);
  Passing passing (live.src);
  live.push (0);
  push_gap (live, 200, 130);
  push_gap (live, 330, 400);
  live.push (730 * GST_MSECOND);
  gst_harness_push_event (live.h, gst_event_new_eos ());
  passing.expect ("P0+100 P100+100 P200+100 P300+100 G400+330 P800+100 P900+100");
}
GST_END_TEST;

GST_START_TEST (test_gap_before_the_first_frame_set_goes_on)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  Passing passing (live.src);
  push_gap (live, 0, 200);
  passing.expect ("G0+200");
}
GST_END_TEST;

GST_START_TEST (test_segment_is_done_after_its_last_picture)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  gst_harness_set_live (live.h, FALSE);
  Passing passing (live.src);
  live.push (0);
  gst_harness_push_event (live.h, gst_event_new_segment_done (GST_FORMAT_TIME, 2 * kPeriod));
  passing.expect ("P0+100 P100+100");
}
GST_END_TEST;

/* ---- times that no clock shows ---- */

GST_START_TEST (test_segment_that_is_not_of_time_passes)
{
  Live live ("auto-orbit=5", "framerate=5/1");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (live.h, gst_event_new_segment (&segment));
  live.push (0);
  live.push (GST_SECOND);
  fail_unless_equals_uint64 (stats_field (live.r, "frames"), 2);
}
GST_END_TEST;

static std::string
pictures_of (std::initializer_list<std::pair<GstClockTime, GstClockTime>> sets)
{
  Live live;
  gst_harness_set_live (live.h, FALSE);
  Passing passing (live.src);
  for (const auto &[pts, duration] : sets) {
    GstBuffer *set = make_frame_set (live.rig, pts);
    GST_BUFFER_DURATION (set) = duration;
    fail_unless_equals_int (gst_harness_push (live.h, set), GST_FLOW_OK);
  }
  gst_harness_push_event (live.h, gst_event_new_eos ());
  return passing.take ();
}

GST_START_TEST (test_times_at_the_end_of_all_numbers_are_no_endless_work)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  for (const GstClockTime pts : {GST_CLOCK_TIME_NONE - 1, GST_CLOCK_TIME_NONE - kPeriod,
           GstClockTime (G_MAXINT64) + 1, GstClockTime (G_MAXINT64)})
    fail_unless (pictures_of ({{0, kPeriod}, {pts, kPeriod}}).starts_with ("P0+100"));
}
GST_END_TEST;

GST_START_TEST (test_absurd_durations_and_holes_are_filled_for_a_minute_at_most)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  const auto count = [] (const std::string &text) { return std::ranges::count (text, 'P'); };
  fail_unless_equals_int (count (pictures_of ({{0, GST_CLOCK_TIME_NONE - 6}})), 600);
  const GstClockTime year = 365 * 24 * 3600 * GST_SECOND;
  fail_unless_equals_int (count (pictures_of ({{0, kPeriod}, {year, kPeriod}})), 602);
}
GST_END_TEST;

/* ---- buffers that upstream wants back ---- */

static void
count_one (gpointer count, GstMiniObject *)
{
  ++*static_cast<int *> (count);
}

GST_START_TEST (test_drain_gives_all_buffers_back_and_the_picture_stays)
{
  for (const bool is_live : {true, false}) {
    Live live;
    if (!live.h)
      RANGECAST_SKIP ("no OpenGL context");
    gst_harness_set_live (live.h, is_live);
    int gone = 0;
    for (guint64 i = 0; i < 3; i++) {
      GstBuffer *set = make_frame_set (live.rig, i * 2 * kPeriod);
      gst_mini_object_weak_ref (GST_MINI_OBJECT (set), count_one, &gone);
      GST_BUFFER_DURATION (set) = 2 * kPeriod;
      fail_unless_equals_int (gst_harness_push (live.h, set), GST_FLOW_OK);
    }
    const auto next = [&] {
      return is_live ? live.next () : take_rendered (gst_harness_pull (live.h), 320);
    };
    const RenderedPicture before = next ();
    const guint64 uploads = stats_field (live.r, "uploaded-total");
    GstQuery *query = gst_query_new_drain ();
    gst_pad_peer_query (live.h->srcpad, query);
    gst_query_unref (query);
    fail_unless_equals_int (gone, 3);
    const RenderedPicture after = next ();
    fail_unless_cmp (after.rgba, ==, before.rgba);
    fail_unless_equals_uint64 (after.shows, before.shows);
    if (is_live) {
      fail_unless_equals_uint64 (stats_field (live.r, "uploaded-total"), uploads);
      fail_unless_equals_uint64 (next ().shows, 2 * kPeriod);
    }
  }
}
GST_END_TEST;

/* ---- pools ---- */

enum class Manner { kEasy, kWantsFive, kRefuses };

struct MannerPool {
  GstGLBufferPool parent;
  Manner manner;
};
struct MannerPoolClass {
  GstGLBufferPoolClass parent_class;
};
G_DEFINE_TYPE (MannerPool, manner_pool, GST_TYPE_GL_BUFFER_POOL)

static gboolean
manner_pool_set_config (GstBufferPool *pool, GstStructure *config)
{
  const Manner manner = reinterpret_cast<MannerPool *> (pool)->manner;
  GstCaps *caps;
  guint size, min, max;
  gst_buffer_pool_config_get_params (config, &caps, &size, &min, &max);
  const bool changed = manner == Manner::kWantsFive && min < 5;
  if (changed)
    gst_buffer_pool_config_set_params (config, caps, size, 5, max);
  const gboolean taken =
      GST_BUFFER_POOL_CLASS (manner_pool_parent_class)->set_config (pool, config);
  return taken && !changed && manner != Manner::kRefuses;
}

static void
manner_pool_init (MannerPool *)
{
}

static void
manner_pool_class_init (MannerPoolClass *klass)
{
  GST_BUFFER_POOL_CLASS (klass)->set_config = manner_pool_set_config;
}

static GstPadProbeReturn
offer_pool (GstPad *, GstPadProbeInfo *info, gpointer pool)
{
  GstQuery *query = GST_PAD_PROBE_INFO_QUERY (info);
  if (GST_QUERY_TYPE (query) != GST_QUERY_ALLOCATION)
    return GST_PAD_PROBE_OK;
  gst_query_add_allocation_pool (query, GST_BUFFER_POOL (pool), 64, 2, 0);
  return GST_PAD_PROBE_HANDLED;
}

static GstPadProbeReturn
see_pool (GstPad *, GstPadProbeInfo *info, gpointer pool)
{
  *static_cast<GstBufferPool **> (pool) = GST_PAD_PROBE_INFO_BUFFER (info)->pool;
  return GST_PAD_PROBE_OK;
}

/* Whether a pool that downstream offers is the one whose buffers come out. */
static bool
is_taken (Manner manner)
{
  Live live ("", "framerate=5/1");
  live.push (0);
  GstGLContext *context = nullptr;
  g_object_get (live.r, "context", &context, nullptr);
  auto pool = static_cast<MannerPool *> (g_object_new (manner_pool_get_type (), nullptr));
  gst_object_ref_sink (pool);
  pool->manner = manner;
  reinterpret_cast<GstGLBufferPool *> (pool)->context = GST_GL_CONTEXT (gst_object_ref (context));
  GstBufferPool *seen = nullptr;
  gst_pad_add_probe (live.src, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM, offer_pool, pool, nullptr);
  gst_pad_add_probe (live.src, GST_PAD_PROBE_TYPE_BUFFER, see_pool, &seen, nullptr);
  gst_pad_send_event (live.src, gst_event_new_reconfigure ());
  live.push (GST_SECOND);
  const bool taken = seen == GST_BUFFER_POOL (pool);
  while (GstBuffer *out = gst_harness_try_pull (live.h))
    fail_unless_equals_int (take_rendered (out, 320).height, 240);
  fail_unless (seen != nullptr);
  gst_object_unref (context);
  gst_object_unref (pool);
  return taken;
}

GST_START_TEST (test_pool_of_downstream_is_used_with_its_own_wishes)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  fail_unless (is_taken (Manner::kEasy));
  fail_unless (is_taken (Manner::kWantsFive));
}
GST_END_TEST;

GST_START_TEST (test_pool_that_refuses_is_replaced_by_one_of_its_own)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  fail_if (is_taken (Manner::kRefuses));
}
GST_END_TEST;

/* ---- failures ---- */

/* The element's errors. */
struct Errors {
  GstElement *element;
  GstBus *bus = gst_bus_new ();

  explicit Errors (GstElement *from) : element (from) { gst_element_set_bus (from, bus); }
  ~Errors ()
  {
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
  }
  /* Waits for one that has that text, and makes sure that no other one follows. */
  void expect_one (const char *text)
  {
    const std::string found = next_message_text (bus, GST_MESSAGE_ERROR);
    fail_unless (found.find (text) != std::string::npos, "'%s'", found.c_str ());
    expect_no_more ();
  }
  void expect_no_more ()
  {
    GstMessage *more = gst_bus_timed_pop_filtered (bus, 50 * GST_MSECOND, GST_MESSAGE_ERROR);
    fail_unless (more == nullptr, "%s", more ? gst_message_type_get_name (more->type) : "");
  }
};

static GstPadProbeReturn
refuse_with (GstPad *, GstPadProbeInfo *info, gpointer flow)
{
  gst_buffer_unref (GST_PAD_PROBE_INFO_BUFFER (info));
  GST_PAD_PROBE_INFO_FLOW_RETURN (info) = GstFlowReturn (GPOINTER_TO_INT (flow));
  return GST_PAD_PROBE_HANDLED;
}

/* A stalled stream whose pictures downstream takes no longer. */
static void
stall_and_refuse (GstFlowReturn flow, const char *text)
{
  Live live;
  live.push (0);
  live.next ();
  Errors errors (live.r);
  gst_pad_add_probe (
      live.src, GST_PAD_PROBE_TYPE_BUFFER, refuse_with, GINT_TO_POINTER (int (flow)), nullptr);
  fail_unless (gst_harness_crank_single_clock_wait (live.h));
  if (text)
    errors.expect_one (text);
  else
    errors.expect_no_more ();
  g_usleep (30000);
  fail_unless_equals_int (gst_test_clock_peek_id_count (live.clock), 0); /* it draws no more */
  fail_unless_equals_int (gst_harness_push (live.h, make_frame_set (live.rig, GST_SECOND)), flow);
  bool ended = false;
  while (GstEvent *event = gst_harness_try_pull_event (live.h)) {
    ended |= GST_EVENT_TYPE (event) == GST_EVENT_EOS;
    gst_event_unref (event);
  }
  fail_unless_equals_int (ended, text != nullptr);
}

GST_START_TEST (test_picture_that_fails_while_the_stream_stalls_is_an_error_and_the_end)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  stall_and_refuse (GST_FLOW_ERROR, "Internal data stream error");
  stall_and_refuse (GST_FLOW_NOT_LINKED, "Internal data stream error");
}
GST_END_TEST;

GST_START_TEST (test_new_stream_is_drawn_after_the_last_one_failed)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  live.push (0);
  live.next ();
  const gulong probe = gst_pad_add_probe (live.src, GST_PAD_PROBE_TYPE_BUFFER, refuse_with,
      GINT_TO_POINTER (int (GST_FLOW_EOS)), nullptr);
  fail_unless (gst_harness_crank_single_clock_wait (live.h));
  GstFlowReturn flow = GST_FLOW_OK;
  for (int tries = 0; tries < 200 && flow == GST_FLOW_OK; tries++) {
    g_usleep (10000);
    flow = gst_harness_push (live.h, make_frame_set (live.rig, 2 * kPeriod));
  }
  fail_unless_equals_int (flow, GST_FLOW_EOS);
  gst_pad_remove_probe (live.src, probe);
  gst_harness_push_event (live.h, gst_event_new_stream_start ("another"));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (live.h, gst_event_new_segment (&segment));
  while (GstBuffer *rest = gst_harness_try_pull (live.h)) /* of the last one */
    gst_buffer_unref (rest);
  live.push (GST_SECOND);
  fail_unless_equals_uint64 (live.next ().pts, GST_SECOND);
}
GST_END_TEST;

GST_START_TEST (test_flush_or_end_of_downstream_while_the_stream_stalls_is_no_error)
{
  if (!opengl_works ())
    RANGECAST_SKIP ("no OpenGL context");
  stall_and_refuse (GST_FLOW_FLUSHING, nullptr);
  stall_and_refuse (GST_FLOW_EOS, nullptr);
}
GST_END_TEST;

GST_START_TEST (test_caps_that_nobody_can_make_while_the_stream_stalls_are_an_error)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  live.push (0);
  live.next ();
  Errors errors (live.r);
  set_output_caps (live.h->element, "width=320,height=240,format=I420");
  fail_unless (gst_harness_crank_single_clock_wait (live.h));
  errors.expect_one ("Internal data stream error");
}
GST_END_TEST;

GST_START_TEST (test_output_task_posts_stream_status)
{
  Live live;
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (live.r, bus);
  live.push (0);
  live.next ();
  gst_element_set_state (live.h->element, GST_STATE_READY);
  for (GstStreamStatusType expected :
      {GST_STREAM_STATUS_TYPE_CREATE, GST_STREAM_STATUS_TYPE_ENTER, GST_STREAM_STATUS_TYPE_LEAVE}) {
    GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_STREAM_STATUS);
    GstStreamStatusType type;
    fail_unless (message != nullptr);
    gst_message_parse_stream_status (message, &type, nullptr);
    fail_unless_equals_int (type, expected);
    gst_message_unref (message);
  }
  gst_element_set_bus (live.r, nullptr);
  gst_object_unref (bus);
}
GST_END_TEST;

GST_START_TEST (test_memory_that_ends_is_one_error_and_no_crash)
{
  Live live ("", "framerate=5/1");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  gst_harness_push (live.h, make_frame_set (live.rig, 0, {100, 80, 10, 10}));
  Errors errors (live.r);
  GstBuffer *large = make_frame_set (live.rig, GST_SECOND);
  largest_piece = 16384;
  const GstFlowReturn flow = gst_harness_push (live.h, gst_buffer_ref (large));
  largest_piece = SIZE_MAX;
  fail_unless_equals_int (flow, GST_FLOW_ERROR);
  errors.expect_one ("memory");
  fail_unless_equals_int (gst_harness_push (live.h, large), GST_FLOW_OK); /* it is none the worse */
  fail_unless_equals_uint64 (stats_field (live.r, "frames"), 2);
}
GST_END_TEST;

GST_START_TEST (test_memory_that_ends_on_the_drawing_thread_is_one_error)
{
  Live live ("mode=points");
  if (!live.h)
    RANGECAST_SKIP ("no OpenGL context");
  gst_harness_push (live.h, make_frame_set (live.rig, 0, {100, 80, 10, 10}));
  live.next ();
  Errors errors (live.r);
  live.push (2 * kPeriod);
  live.next ();
  largest_piece = 16384;
  fail_unless (gst_harness_crank_single_clock_wait (live.h));
  errors.expect_one ("memory");
  largest_piece = SIZE_MAX;
  fail_unless_equals_int (
      gst_harness_push (live.h, make_frame_set (live.rig, GST_SECOND)), GST_FLOW_ERROR);
  errors.expect_no_more ();
}
GST_END_TEST;

GST_START_TEST (test_statistics_count_pictures_and_points)
{
  const Rig rig = ring_rig (1, 64, 48);
  GstHarness *h = render_harness (rig, "stats-interval=3600000");
  if (!h)
    RANGECAST_SKIP ("no OpenGL context");
  GstElement *r = gst_bin_get_by_name (GST_BIN (h->element), "r");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (r, bus);
  guint64 points = 0;
  for (GstClockTime i = 0; i < 3; i++) {
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig, i * GST_SECOND / 30)));
    points += stats_field (r, "points");
  }
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ELEMENT);
  fail_unless (message && gst_message_has_name (message, "rangecast-stats"));
  const GstStructure *stats = gst_message_get_structure (message);
  guint64 frames = 0, counted = 0, late = 1;
  gst_structure_get_uint64 (stats, "frames", &frames);
  gst_structure_get_uint64 (stats, "points", &counted);
  gst_structure_get_uint64 (stats, "late", &late);
  fail_unless_equals_uint64 (frames, 3);
  ck_assert_uint_gt (points, 0);
  fail_unless_equals_uint64 (counted, points);
  fail_unless_equals_uint64 (late, 0);
  gst_message_unref (message);
  gst_element_set_bus (r, nullptr);
  gst_object_unref (bus);
  gst_object_unref (r);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
striprenderflow_suite ()
{
  Suite *suite = suite_create ("striprenderflow");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_statistics_count_pictures_and_points);
  tcase_add_test (tc, test_gap_after_hold_time_goes_on);
  tcase_add_test (tc, test_rest_of_a_live_gap_follows_the_pictures_that_fill_it);
  tcase_add_test (tc, test_gap_comes_between_the_pictures_beside_it);
  tcase_add_test (tc, test_gap_of_a_file_is_filled_as_long_as_hold_time_says_and_the_rest_goes_on);
  tcase_add_test (tc, test_gap_before_the_first_frame_set_goes_on);
  tcase_add_test (tc, test_segment_is_done_after_its_last_picture);
  tcase_add_test (tc, test_segment_that_is_not_of_time_passes);
  tcase_add_test (tc, test_times_at_the_end_of_all_numbers_are_no_endless_work);
  tcase_add_test (tc, test_absurd_durations_and_holes_are_filled_for_a_minute_at_most);
  tcase_add_test (tc, test_drain_gives_all_buffers_back_and_the_picture_stays);
  tcase_add_test (tc, test_pool_of_downstream_is_used_with_its_own_wishes);
  tcase_add_test (tc, test_pool_that_refuses_is_replaced_by_one_of_its_own);
  tcase_add_test (tc, test_picture_that_fails_while_the_stream_stalls_is_an_error_and_the_end);
  tcase_add_test (tc, test_new_stream_is_drawn_after_the_last_one_failed);
  tcase_add_test (tc, test_flush_or_end_of_downstream_while_the_stream_stalls_is_no_error);
  tcase_add_test (tc, test_caps_that_nobody_can_make_while_the_stream_stalls_are_an_error);
  tcase_add_test (tc, test_output_task_posts_stream_status);
  tcase_add_test (tc, test_memory_that_ends_is_one_error_and_no_crash);
  tcase_add_test (tc, test_memory_that_ends_on_the_drawing_thread_is_one_error);
  return suite;
}

GST_CHECK_MAIN (striprenderflow);
