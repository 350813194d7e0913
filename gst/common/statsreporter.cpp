/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "statsreporter.hpp"

#include "common/properties.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <gstrange/gstrange.h>
#include <mutex>

namespace {

constexpr guint kMaxIntervalMs = 3600000;
/* Per interval; of more, the most recent ones count. */
constexpr std::size_t kMaxLatencies = 1024;
/* A greater time since capture means that the clocks are unrelated, ns. */
constexpr gint64 kMaxLatency = 10 * GST_SECOND;

/* A row of the previous message. */
struct PreviousRow {
  std::string pad;
  StreamCounters counters;
};

} // namespace

struct StatsReporter::State {
  /* Locking order: `reporting`, then the locks that collect() takes, or `lock`. So start() and
   * finish(), which take `reporting`, must be called without the element's locks. With `lock` held
   * only the clock is called. No lock is held while posting. */
  std::mutex reporting; /* guards previous, since */
  std::vector<PreviousRow> previous;
  GstClockTime since = 0; /* start of the interval */

  std::atomic<guint> interval_ms = 0; /* written with `lock` held */

  std::mutex lock;           /* guards the members up to n_latencies */
  Collect collect = nullptr; /* null: stopped */
  GstClockID timer = nullptr;
  guint64 views = 0;
  std::array<gint32, kMaxLatencies> latencies_us{};
  std::size_t n_latencies = 0; /* recorded; latencies_us is a ring */

  std::atomic<bool> is_reporting{false}; /* a report that the timer started is in progress */

  GWeakRef element; /* thread-safe; set before the timer starts */

  State () { g_weak_ref_init (&element, nullptr); }
  ~State () { g_weak_ref_clear (&element); }
  void schedule (const std::shared_ptr<State> &self);
  void unschedule ();
  void report (bool at_end);
  void report_async ();
  std::vector<GstStructure *> make_messages (
      GstElement *e, const std::vector<StatsRow> &rows, GstClockTime interval);
};

guint64
view_bits (const rangecast::Rig &rig)
{
  guint64 bits = 0;
  for (const rangecast::View &view : rig.views)
    bits |= guint64{1} << (view.id & 63);
  return bits;
}

/* ---- messages ---- */

static void
set_views_field (GstStructure *s, guint64 views)
{
  GValue array = G_VALUE_INIT, id = G_VALUE_INIT;
  g_value_init (&array, GST_TYPE_ARRAY);
  g_value_init (&id, G_TYPE_INT);
  for (int i = 0; i < 64; i++)
    if (views >> i & 1) {
      g_value_set_int (&id, i);
      gst_value_array_append_value (&array, &id);
    }
  g_value_unset (&id);
  gst_structure_take_value (s, "view-ids", &array);
}

/* A counter that decreased was reset in between. */
static guint64
increase (guint64 now, guint64 previous)
{
  return now >= previous ? now - previous : now;
}

static void
set_count (GstStructure *s, const char *field, const std::optional<guint64> &count)
{
  if (count)
    gst_structure_set (s, field, G_TYPE_UINT64, *count, nullptr);
}

static GstStructure *
make_structure (
    GstElement *element, const StatsRow &row, const StreamCounters &previous, GstClockTime interval)
{
  const StreamCounters &now = row.counters;
  GstElementFactory *factory = gst_element_get_factory (element);
  GstStructure *s = gst_structure_new ("rangecast-stats", "element", G_TYPE_STRING,
      factory ? GST_OBJECT_NAME (factory) : G_OBJECT_TYPE_NAME (element), "interval", G_TYPE_UINT64,
      interval, nullptr);
  if (!row.pad.empty ())
    gst_structure_set (s, "pad", G_TYPE_STRING, row.pad.c_str (), nullptr);
  if (row.views)
    set_views_field (s, row.views);
  const double seconds = double (std::max<GstClockTime> (interval, 1)) / GST_SECOND;
  const guint64 frames = increase (now.frames, previous.frames);
  gst_structure_set (s, "frames", G_TYPE_UINT64, now.frames, "fps", G_TYPE_DOUBLE,
      double (frames) / seconds, nullptr);
  set_count (s, "points", now.points);
  if (now.points && frames > 0)
    gst_structure_set (s, "points-per-frame", G_TYPE_DOUBLE,
        double (increase (*now.points, previous.points.value_or (0))) / double (frames), nullptr);
  set_count (s, "bytes", now.bytes);
  if (now.bytes)
    gst_structure_set (s, "bitrate", G_TYPE_UINT64,
        guint64 (8 * double (increase (*now.bytes, previous.bytes.value_or (0))) / seconds + 0.5),
        nullptr);
  set_count (s, "packets", now.packets);
  set_count (s, "lost", now.lost);
  set_count (s, "late", now.late);
  if (row.latency_p50 && row.latency_p99)
    gst_structure_set (s, "latency-p50", G_TYPE_INT64, *row.latency_p50, "latency-p99",
        G_TYPE_INT64, *row.latency_p99, nullptr);
  return s;
}

/* @param[in,out] us  gets partially sorted */
static gint64
quantile_ns (std::span<gint32> us, double share)
{
  const auto k = static_cast<std::ptrdiff_t> (share * double (us.size () - 1) + 0.5);
  std::nth_element (us.begin (), us.begin () + k, us.end ());
  return gint64{us[std::size_t (k)]} * 1000;
}

/* With `reporting` held. The latencies go into the first row, the element's own. */
std::vector<GstStructure *>
StatsReporter::State::make_messages (
    GstElement *e, const std::vector<StatsRow> &rows, GstClockTime interval)
{
  std::vector<GstStructure *> messages;
  std::vector<PreviousRow> now;
  for (const StatsRow &row : rows) {
    const auto found = std::ranges::find (previous, row.pad, &PreviousRow::pad);
    messages.push_back (make_structure (
        e, row, found == previous.end () ? StreamCounters () : found->counters, interval));
    now.push_back ({row.pad, row.counters});
  }
  previous = std::move (now);
  if (messages.empty ())
    return messages;
  std::lock_guard guard (lock);
  if (views)
    set_views_field (messages[0], views);
  const std::span<gint32> known (latencies_us.data (), std::min (n_latencies, kMaxLatencies));
  n_latencies = 0;
  if (!known.empty ())
    gst_structure_set (messages[0], "latency-p50", G_TYPE_INT64, quantile_ns (known, 0.5),
        "latency-p99", G_TYPE_INT64, quantile_ns (known, 0.99), nullptr);
  return messages;
}

void
StatsReporter::State::report (bool at_end)
{
  auto e = static_cast<GstElement *> (g_weak_ref_get (&element));
  Collect read;
  guint ms;
  {
    std::lock_guard guard (lock);
    read = collect;
    ms = interval_ms;
  }
  if (!e || !read || ms == 0) {
    gst_clear_object (&e);
    return;
  }
  GST_OBJECT_LOCK (e);
  const bool plays = GST_STATE (e) == GST_STATE_PLAYING;
  GST_OBJECT_UNLOCK (e);
  std::vector<GstStructure *> messages;
  {
    std::lock_guard guard (reporting);
    const GstClockTime now = gst_util_get_timestamp (), interval = now - since;
    /* A timer that fires late fires again early: skip the short interval. */
    if (at_end || (plays && interval >= ms * GST_MSECOND / 2)) {
      since = now;
      messages = make_messages (e, read (e), interval);
    }
  }
  for (GstStructure *message : messages)
    gst_element_post_message (e, gst_message_new_element (GST_OBJECT (e), message));
  gst_object_unref (e);
}

/* ---- the timer ---- */

/* The clock's thread serves all timers of the process. A synchronous message handler must not block
 * it, nor must finalizing an element of which this may be the last reference. So this reference is
 * handed to gst_element_call_async(), whose own reference keeps the element, and with it this
 * state, until the report is done. */
void
StatsReporter::State::report_async ()
{
  if (is_reporting.exchange (true)) /* a handler of the previous message still runs */
    return;
  auto e = static_cast<GstElement *> (g_weak_ref_get (&element));
  if (!e)
    return;
  const auto work = [] (GstElement *element, gpointer data) {
    State &state = *static_cast<State *> (data);
    state.report (false);
    state.is_reporting = false;
    gst_object_unref (element); /* taken on the clock's thread */
  };
  gst_element_call_async (e, work, this, nullptr);
}

/* With `lock` held. */
void
StatsReporter::State::unschedule ()
{
  if (!timer)
    return;
  gst_clock_id_unschedule (timer);
  gst_clock_id_unref (timer);
  timer = nullptr;
}

/* With `lock` held. */
void
StatsReporter::State::schedule (const std::shared_ptr<State> &self)
{
  unschedule ();
  if (!collect || interval_ms == 0)
    return;
  GstClock *clock = gst_system_clock_obtain ();
  const GstClockTime interval = interval_ms * GST_MSECOND;
  timer = gst_clock_new_periodic_id (clock, gst_clock_get_time (clock) + interval, interval);
  gst_object_unref (clock);
  const auto on_time = [] (GstClock *, GstClockTime time, GstClockID, gpointer data) -> gboolean {
    if (GST_CLOCK_TIME_IS_VALID (time))
      (*static_cast<std::shared_ptr<State> *> (data))->report_async ();
    return TRUE;
  };
  const auto destroy = [] (gpointer data) { delete static_cast<std::shared_ptr<State> *> (data); };
  gst_clock_id_wait_async (timer, on_time, new std::shared_ptr<State> (self), destroy);
}

/* ---- the element's side ---- */

StatsReporter::StatsReporter () : state_ (std::make_shared<State> ()) {}

StatsReporter::~StatsReporter ()
{
  stop ();
}

void
StatsReporter::install (GObjectClass *object_class, guint property_id)
{
  g_object_class_install_property (object_class, property_id,
      g_param_spec_uint ("stats-interval", "Statistics interval",
          "Interval between rangecast-stats messages in milliseconds (0 = never)", 0,
          kMaxIntervalMs, 0, kMutablePlaying));
}

void
StatsReporter::set_interval (guint interval_ms)
{
  std::lock_guard guard (state_->lock);
  if (state_->interval_ms == interval_ms)
    return;
  state_->interval_ms = interval_ms;
  state_->schedule (state_);
}

guint
StatsReporter::interval () const
{
  return state_->interval_ms;
}

void
StatsReporter::start (GstElement *element, Collect collect)
{
  stop ();
  g_weak_ref_set (&state_->element, element);
  {
    std::lock_guard guard (state_->reporting);
    state_->previous.clear ();
    state_->since = gst_util_get_timestamp ();
  }
  std::lock_guard guard (state_->lock);
  state_->n_latencies = 0;
  state_->views = 0;
  state_->collect = collect;
  state_->schedule (state_);
}

void
StatsReporter::stop ()
{
  std::lock_guard guard (state_->lock);
  state_->collect = nullptr;
  state_->unschedule ();
}

void
StatsReporter::set_views (const rangecast::Rig &rig)
{
  const guint64 bits = view_bits (rig);
  std::lock_guard guard (state_->lock);
  state_->views = bits;
}

void
StatsReporter::passed (GstElement *element, GstBuffer *buffer)
{
  State &state = *state_;
  const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
  if (!GST_CLOCK_TIME_IS_VALID (capture))
    return;
  GstClock *clock = gst_element_get_clock (element);
  if (!clock)
    return;
  const gint64 latency = GST_CLOCK_DIFF (capture, gst_clock_get_time (clock));
  gst_object_unref (clock);
  if (latency < -kMaxLatency || latency > kMaxLatency)
    return;
  std::lock_guard guard (state.lock);
  state.latencies_us[state.n_latencies++ % kMaxLatencies] = gint32 (latency / 1000);
}

void
StatsReporter::finish ()
{
  state_->report (true);
}
