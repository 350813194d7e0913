/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <string>

#include "../../fuzz/guarded_bytes.hpp"
#include "../failing-memory.hpp"

using namespace rangecast::testing;

static constexpr guint32 kSender = 0x1234, kReceiver = 0x77;

struct Session {
  GstElement *element = gst_element_factory_make ("rtcpreports", nullptr);
  GstHarness *rtp, *rtcp;

  Session ()
  {
    fail_unless (element != nullptr);
    rtp = gst_harness_new_with_element (element, "sink", "src");
    rtcp = gst_harness_new_with_element (element, "rtcp_sink", "rtcp_src");
    gst_harness_set_src_caps_str (
        rtp, "application/x-rtp, media=video, clock-rate=90000, payload=96");
    gst_harness_set_src_caps_str (rtcp, "application/x-rtcp");
    gst_harness_set_drop_buffers (rtp, FALSE);
  }
  ~Session ()
  {
    gst_harness_teardown (rtcp);
    gst_harness_teardown (rtp);
    gst_object_unref (element);
  }
  void push_rtp (guint32 ssrc = kSender)
  {
    GstBuffer *packet = gst_rtp_buffer_new_allocate (100, 0, 0);
    GstRTPBuffer mapped = GST_RTP_BUFFER_INIT;
    fail_unless (gst_rtp_buffer_map (packet, GST_MAP_WRITE, &mapped));
    gst_rtp_buffer_set_ssrc (&mapped, ssrc);
    gst_rtp_buffer_unmap (&mapped);
    gst_buffer_unref (gst_harness_push_and_pull (rtp, packet));
  }
  /* @return whether it got through, as it was */
  bool offer (GstBuffer *packet, GstClockTime time = 0, const char *address = "10.0.0.7")
  {
    GstBuffer *before = gst_buffer_copy (packet);
    if (address) {
      GSocketAddress *from = g_inet_socket_address_new_from_string (address, 5000);
      gst_buffer_add_net_address_meta (packet, from);
      g_object_unref (from);
    }
    GST_BUFFER_PTS (packet) = GST_BUFFER_DTS (packet) = time;
    fail_unless_equals_int (gst_harness_push (rtcp, packet), GST_FLOW_OK);
    GstBuffer *out = gst_harness_try_pull (rtcp);
    if (out) {
      GstMapInfo map;
      gst_buffer_map (out, &map, GST_MAP_READ);
      fail_unless_equals_int (gst_buffer_get_size (before), map.size);
      fail_unless_equals_int (gst_buffer_memcmp (before, 0, map.data, map.size), 0);
      gst_buffer_unmap (out, &map);
      gst_buffer_unref (out);
    }
    gst_buffer_unref (before);
    return out != nullptr;
  }
  /* @return the events that come of it, as structures to free */
  std::vector<GstStructure *> push_rtcp (GstBuffer *packet)
  {
    offer (packet);
    std::vector<GstStructure *> reports;
    while (GstEvent *event = gst_harness_try_pull_upstream_event (rtp)) {
      const GstStructure *s = gst_event_get_structure (event);
      if (s && gst_structure_has_name (s, "RangecastReceiverReport"))
        reports.push_back (gst_structure_copy (s));
      gst_event_unref (event);
    }
    return reports;
  }
  guint64 stat (const char *field)
  {
    GstStructure *stats;
    guint64 value = G_MAXUINT64;
    g_object_get (element, "stats", &stats, nullptr);
    gst_structure_get_uint64 (stats, field, &value);
    gst_structure_free (stats);
    return value;
  }
};

struct Report {
  guint32 sender = kSender;
  guint8 lost = 64;
  guint32 highest = 1000, jitter = 900, last_sr = 0, delay = 0;
};

static GstBuffer *
receiver_report (
    const std::vector<Report> &reports, bool of_sender = false, guint32 receiver = kReceiver)
{
  GstBuffer *buffer = gst_rtcp_buffer_new (1400);
  GstRTCPBuffer rtcp = GST_RTCP_BUFFER_INIT;
  GstRTCPPacket packet;
  fail_unless (gst_rtcp_buffer_map (buffer, GST_MAP_READWRITE, &rtcp));
  fail_unless (
      gst_rtcp_buffer_add_packet (&rtcp, of_sender ? GST_RTCP_TYPE_SR : GST_RTCP_TYPE_RR, &packet));
  if (of_sender)
    gst_rtcp_packet_sr_set_sender_info (&packet, receiver, 0, 0, 0, 0);
  else
    gst_rtcp_packet_rr_set_ssrc (&packet, receiver);
  for (const Report &r : reports)
    fail_unless (gst_rtcp_packet_add_rb (
        &packet, r.sender, r.lost, 5, r.highest, r.jitter, r.last_sr, r.delay));
  gst_rtcp_buffer_unmap (&rtcp);
  return buffer;
}

static void
free_all (std::vector<GstStructure *> &reports)
{
  for (GstStructure *report : reports)
    gst_structure_free (report);
}

GST_START_TEST (test_report_becomes_an_event_upstream)
{
  for (const bool of_sender : {false, true}) {
    Session session;
    session.push_rtp ();
    auto reports = session.push_rtcp (receiver_report ({{}}, of_sender));
    fail_unless_equals_int (reports.size (), 1);
    guint ssrc = 0, packets = 99;
    guint64 jitter = 0, trip = 99;
    double lost = 0;
    fail_unless (gst_structure_get (reports[0], "ssrc", G_TYPE_UINT, &ssrc, "fraction-lost",
        G_TYPE_DOUBLE, &lost, "packets", G_TYPE_UINT, &packets, "jitter", G_TYPE_UINT64, &jitter,
        "round-trip-time", G_TYPE_UINT64, &trip, nullptr));
    fail_unless_equals_int (ssrc, kReceiver);
    fail_unless_equals_float (lost, 0.25);
    fail_unless_equals_int (packets, 0);
    fail_unless_equals_uint64 (jitter, 10 * GST_MSECOND);
    fail_unless_equals_uint64 (trip, 0);
    free_all (reports);
  }
}
GST_END_TEST;

GST_START_TEST (test_packets_are_those_since_the_report_before)
{
  Session session;
  session.push_rtp ();
  auto reports = session.push_rtcp (receiver_report ({{.highest = 0x1fff0}}));
  free_all (reports);
  reports = session.push_rtcp (receiver_report ({{.highest = 0x20050}}));
  guint packets = 0;
  fail_unless (gst_structure_get_uint (reports[0], "packets", &packets));
  fail_unless_equals_int (packets, 0x60);
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_round_trip_is_now_less_the_last_report_less_the_delay)
{
  Session session;
  session.push_rtp ();
  const auto ntp =
      guint32 (gst_util_uint64_scale (guint64 (g_get_real_time ()), 65536, G_USEC_PER_SEC) +
               (guint64{2208988800} << 16));
  auto reports =
      session.push_rtcp (receiver_report ({{.last_sr = ntp - 3 * 65536, .delay = 65536}}));
  guint64 trip = 0;
  fail_unless (gst_structure_get_uint64 (reports[0], "round-trip-time", &trip));
  fail_unless (trip >= 1990 * GST_MSECOND, "%" G_GUINT64_FORMAT, trip); /* later: more */
  free_all (reports);
  reports = session.push_rtcp (receiver_report ({{.last_sr = ntp + 9 * 65536}}));
  fail_unless (gst_structure_get_uint64 (reports[0], "round-trip-time", &trip));
  fail_unless_equals_uint64 (trip, 0); /* of the future: another clock */
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_reports_about_other_streams_are_none)
{
  Session session;
  auto reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 0); /* no stream yet */
  session.push_rtp ();
  reports = session.push_rtcp (receiver_report ({{.sender = 1}, {}, {.sender = 2}}));
  fail_unless_equals_int (reports.size (), 1);
  free_all (reports);
  session.push_rtp (1);
  reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 0);
}
GST_END_TEST;

GST_START_TEST (test_bytes_that_are_no_rtcp_tell_nothing)
{
  Session session;
  session.push_rtp ();
  GRand *random = g_rand_new_with_seed (1);
  for (int i = 0; i < 2000; i++) {
    GstBuffer *good = receiver_report ({{}});
    GstMapInfo map;
    gst_buffer_map (good, &map, GST_MAP_READWRITE);
    for (int k = 0; k < 3; k++)
      map.data[g_rand_int_range (random, 0, gint (map.size))] = guint8 (g_rand_int (random));
    const gsize size = gsize (g_rand_int_range (random, 1, gint (map.size) + 1));
    GstBuffer *bad = gst_buffer_new_memdup (map.data, size);
    gst_buffer_unmap (good, &map);
    gst_buffer_unref (good);
    auto reports = session.push_rtcp (bad);
    free_all (reports);
  }
  g_rand_free (random);
  auto reports = session.push_rtcp (receiver_report ({{}}));
  fail_unless_equals_int (reports.size (), 1);
  free_all (reports);
}
GST_END_TEST;

GST_START_TEST (test_events_of_one_stream_do_not_reach_the_other)
{
  Session session;
  session.push_rtp ();
  while (GstEvent *event = gst_harness_try_pull_event (session.rtp))
    gst_event_unref (event);
  while (GstEvent *event = gst_harness_try_pull_event (session.rtcp))
    gst_event_unref (event);
  fail_unless (session.offer (receiver_report ({{}})));
  gst_harness_push_event (session.rtcp, gst_event_new_eos ());
  fail_unless (gst_harness_try_pull_event (session.rtp) == nullptr);
  GstEvent *eos = gst_harness_try_pull_event (session.rtcp);
  fail_unless (eos);
  ck_assert_int_eq (GST_EVENT_TYPE (eos), GST_EVENT_EOS);
  gst_event_unref (eos);
  session.push_rtp ();
}
GST_END_TEST;

/* Adds a packet of that kind to a compound one. */
static GstBuffer *
with (GstBuffer *buffer, GstRTCPType type, guint32 ssrc, guint32 about = 0)
{
  GstRTCPBuffer rtcp = GST_RTCP_BUFFER_INIT;
  GstRTCPPacket packet;
  fail_unless (gst_rtcp_buffer_map (buffer, GST_MAP_READWRITE, &rtcp));
  fail_unless (gst_rtcp_buffer_add_packet (&rtcp, type, &packet));
  if (type == GST_RTCP_TYPE_SDES) {
    gst_rtcp_packet_sdes_add_item (&packet, ssrc);
    gst_rtcp_packet_sdes_add_entry (
        &packet, GST_RTCP_SDES_CNAME, 1, reinterpret_cast<const guint8 *> ("x"));
  } else if (type == GST_RTCP_TYPE_BYE) {
    gst_rtcp_packet_bye_add_ssrc (&packet, ssrc);
  } else {
    gst_rtcp_packet_fb_set_type (&packet, GST_RTCP_PSFB_TYPE_PLI);
    gst_rtcp_packet_fb_set_sender_ssrc (&packet, ssrc);
    gst_rtcp_packet_fb_set_media_ssrc (&packet, about);
  }
  gst_rtcp_buffer_unmap (&rtcp);
  return buffer;
}

GST_START_TEST (test_rtcp_that_is_not_about_the_stream_does_not_pass)
{
  Session session;
  fail_if (session.offer (receiver_report ({{}}))); /* there is none yet */
  session.push_rtp ();
  fail_if (session.offer (receiver_report ({})));
  fail_if (session.offer (receiver_report ({{.sender = 5}})));
  fail_if (session.offer (with (receiver_report ({}), GST_RTCP_TYPE_SDES, kReceiver)));
  fail_if (session.offer (with (receiver_report ({}), GST_RTCP_TYPE_BYE, kReceiver)));
  fail_unless_equals_uint64 (session.stat ("receivers"), 0);
  fail_unless_equals_uint64 (session.stat ("refused"), 5);
  fail_unless (session.offer (receiver_report ({{}})));
  fail_unless (session.offer (receiver_report ({}))); /* now it is known */
  fail_unless (session.offer (with (receiver_report ({}), GST_RTCP_TYPE_BYE, kReceiver)));
  fail_unless_equals_uint64 (session.stat ("receivers"), 1);
}
GST_END_TEST;

GST_START_TEST (test_a_request_about_the_stream_is_enough)
{
  Session session;
  session.push_rtp ();
  const auto request = [] (guint32 about) {
    return with (gst_rtcp_buffer_new (1400), GST_RTCP_TYPE_PSFB, kReceiver, about);
  };
  fail_if (session.offer (request (kSender + 1)));
  fail_unless (session.offer (request (kSender)));
}
GST_END_TEST;

/* One packet would make up to 31 sources, or end those of others. */
GST_START_TEST (test_who_speaks_for_others_or_as_the_sender_does_not_pass)
{
  Session session;
  session.push_rtp ();
  fail_if (session.offer (with (receiver_report ({{}}), GST_RTCP_TYPE_SDES, 5)));
  fail_if (session.offer (with (receiver_report ({{}}), GST_RTCP_TYPE_BYE, 5)));
  fail_if (session.offer (receiver_report ({{}}, false, kSender)));
  fail_unless (session.offer (with (receiver_report ({{}}), GST_RTCP_TYPE_SDES, kReceiver)));
}
GST_END_TEST;

GST_START_TEST (test_one_who_is_known_does_not_pass_from_another_address)
{
  Session session;
  session.push_rtp ();
  fail_unless (session.offer (receiver_report ({{}}), 0, "10.0.0.7"));
  fail_if (session.offer (receiver_report ({{}}), GST_SECOND, "10.0.0.8"));
  fail_unless (session.offer (receiver_report ({{}}), 10 * GST_SECOND, "10.0.0.7"));
  fail_unless (session.offer (receiver_report ({{}}), 60 * GST_SECOND, "10.0.0.8"));
}
GST_END_TEST;

GST_START_TEST (test_a_flood_of_receivers_that_know_the_stream_leaves_room_for_others)
{
  Session session;
  session.push_rtp ();
  g_object_set (session.element, "max-receivers", 40, nullptr);
  fail_unless (session.offer (receiver_report ({{}}, false, 1), 0, "10.0.0.1"));
  for (guint32 i = 0; i < 5000; i++)
    session.offer (receiver_report ({{}}, false, 1000 + i), i * GST_MSECOND, "10.0.0.9");
  fail_unless_equals_uint64 (session.stat ("receivers"), 11); /* a quarter, and who was there */
  fail_unless (session.offer (receiver_report ({{}}, false, 1), 5 * GST_SECOND, "10.0.0.1"));
  fail_unless (session.offer (receiver_report ({{}}, false, 2), 5 * GST_SECOND, "10.0.0.2"));
  for (guint32 i = 0; i < 5000; i++) /* from everywhere */
    session.offer (receiver_report ({{}}, false, 10000 + i), 6 * GST_SECOND,
        ("10.1." + std::to_string (i / 250) + "." + std::to_string (i % 250 + 1)).c_str ());
  fail_unless_equals_uint64 (session.stat ("receivers"), 40);
  fail_unless (session.offer (receiver_report ({{}}, false, 1), 7 * GST_SECOND, "10.0.0.1"));
}
GST_END_TEST;

GST_START_TEST (test_who_is_silent_for_half_a_minute_makes_room)
{
  Session session;
  session.push_rtp ();
  g_object_set (session.element, "max-receivers", 1, nullptr);
  fail_unless (session.offer (receiver_report ({{}}, false, 1), 0));
  fail_if (session.offer (receiver_report ({{}}, false, 2), 29 * GST_SECOND));
  fail_unless (session.offer (receiver_report ({{}}, false, 2), 31 * GST_SECOND));
  fail_if (session.offer (receiver_report ({{}}, false, 1), 32 * GST_SECOND));
}
GST_END_TEST;

/* ---- bytes from a network ---- */

using Bytes = std::vector<guint8>;

/* In memory of exactly their size, and in such before memory that nobody may read: the first is for
 * what watches memory, the second crashes without. @return whether they got through */
static bool
offer_bytes (Session &session, const Bytes &bytes)
{
  auto heap = static_cast<guint8 *> (g_malloc (std::max<gsize> (bytes.size (), 1)));
  std::copy (bytes.begin (), bytes.end (), heap);
  const bool passed = session.offer (gst_buffer_new_wrapped (heap, bytes.size ()));
  GuardedBytes memory;
  const auto copy = memory.copy (bytes);
  GstBuffer *guarded = gst_buffer_new_wrapped_full (
      GST_MEMORY_FLAG_READONLY, copy.data (), copy.size (), 0, copy.size (), nullptr, nullptr);
  fail_unless_equals_int (session.offer (guarded), passed);
  return passed;
}

static Bytes
bytes_of (GstBuffer *buffer)
{
  Bytes bytes (gst_buffer_get_size (buffer));
  gst_buffer_extract (buffer, 0, bytes.data (), bytes.size ());
  gst_buffer_unref (buffer);
  return bytes;
}

static constexpr guint8 kFrom = kReceiver;
static const Bytes kReceiverReport = {0x80, 201, 0, 1, 0, 0, 0, kFrom};

static Bytes
operator+ (Bytes a, const Bytes &b)
{
  a.insert (a.end (), b.begin (), b.end ());
  return a;
}

/* gst_rtcp_packet_sdes_first_item() of 1.22 says that there is a chunk. */
GST_START_TEST (test_a_chunk_that_is_announced_but_not_there_is_not_read)
{
  Session session;
  session.push_rtp ();
  fail_if (offer_bytes (session, {0x80, 201, 0, 1, 0, 0, 0, 1, 0x81, 202, 0, 0}));
  fail_unless_equals_uint64 (session.stat ("malformed"), 2);
}
GST_END_TEST;

GST_START_TEST (test_no_prefix_of_good_packets_is_read_beyond_its_end)
{
  Session session;
  session.push_rtp ();
  const auto report = [] (bool of_sender) {
    return receiver_report ({{}, {.sender = 9}}, of_sender);
  };
  const auto with_more = [] (GstBuffer *buffer) {
    return with (
        with (with (buffer, GST_RTCP_TYPE_SDES, kReceiver), GST_RTCP_TYPE_PSFB, kReceiver, kSender),
        GST_RTCP_TYPE_BYE, kReceiver);
  };
  for (const Bytes &whole :
      {bytes_of (with_more (report (false))), bytes_of (with_more (report (true))),
          bytes_of (with (gst_rtcp_buffer_new (1400), GST_RTCP_TYPE_PSFB, kReceiver, kSender))}) {
    fail_unless (offer_bytes (session, whole));
    for (std::size_t size = 1; size < whole.size (); size++)
      offer_bytes (session, Bytes (whole.begin (), whole.begin () + std::ptrdiff_t (size)));
    for (std::size_t i = 0; i < whole.size (); i++) /* and none that lies */
      for (const guint8 value : {0, 1, 31, 127, 255}) {
        Bytes wrong = whole;
        wrong[i] = value;
        offer_bytes (session, wrong);
      }
  }
  fail_unless (offer_bytes (session, bytes_of (with_more (report (false)))));
}
GST_END_TEST;

GST_START_TEST (test_packets_that_lie_about_what_is_in_them_are_malformed)
{
  const Bytes lies[] = {
      {0x81, 201, 0, 1, 0, 0, 0, kFrom},                                    /* a report block */
      {0x80, 200, 0, 1, 0, 0, 0, kFrom},                                    /* a sender's report */
      {0x80, 201, 0, 0},                                                    /* who reports */
      {0x80, 201, 0, 2, 0, 0, 0, kFrom},                                    /* its size */
      kReceiverReport + Bytes{0x82, 202, 0, 2, 0, 0, 0, kFrom, 0, 0, 0, 0}, /* a second chunk */
      kReceiverReport + Bytes{0x81, 202, 0, 2, 0, 0, 0, kFrom, 1, 3, 'x', 0}, /* an item's size */
      kReceiverReport +
          Bytes{0x81, 202, 0, 2, 0, 0, 0, kFrom, 1, 1, 'x', 1}, /* an item without size */
      kReceiverReport + Bytes{0x82, 203, 0, 1, 0, 0, 0, kFrom}, /* who else says good-bye */
      kReceiverReport + Bytes{0x81, 206, 0, 1, 0, 0, 0, kFrom}, /* about whom */
      kReceiverReport + Bytes{0xa0, 204, 0, 2, 0, 0, 0, kFrom, 0, 0, 0, 12}, /* its padding, ... */
      kReceiverReport + Bytes{0xa0, 204, 0, 2, 0, 0, 0, kFrom, 0, 0, 0, 0},
      kReceiverReport + Bytes{0xa1, 203, 0, 1, 0, 0, 0, 4}, /* ... which is all that it has */
      kReceiverReport + Bytes{0x40, 203, 0, 0},             /* its version */
      kReceiverReport + Bytes{0x80},
      {},
  };
  for (const Bytes &lie : lies) {
    Session session;
    session.push_rtp ();
    fail_unless (offer_bytes (session, bytes_of (receiver_report ({{}}))));
    fail_if (offer_bytes (session, lie));
    fail_unless_equals_uint64 (session.stat ("malformed"), 2);
    fail_unless_equals_uint64 (session.stat ("refused"), 0);
  }
}
GST_END_TEST;

/* As FFmpeg sends it where the text ends with 32 bits; and what RFC 3550 leaves to others. */
GST_START_TEST (test_packets_that_are_odd_but_whole_pass)
{
  Session session;
  session.push_rtp ();
  fail_unless (offer_bytes (session, bytes_of (receiver_report ({{}}))));
  for (const Bytes &odd : {Bytes{0x81, 202, 0, 2, 0, 0, 0, kFrom, 1, 2, 'x', 'y'},
           Bytes{0x81, 202, 0, 2, 0, 0, 0, kFrom, 0, 0, 0, 0}, Bytes{0x80, 202, 0, 0},
           Bytes{0x80, 203, 0, 0}, Bytes{0x80, 210, 0, 0},
           Bytes{0xa1, 203, 0, 2, 0, 0, 0, kFrom, 0, 0, 0, 4}})
    fail_unless (offer_bytes (session, kReceiverReport + odd));
  fail_unless_equals_uint64 (session.stat ("malformed"), 0);
}
GST_END_TEST;

GST_START_TEST (test_each_chunk_says_who_speaks)
{
  Session session;
  session.push_rtp ();
  fail_unless (offer_bytes (session, bytes_of (receiver_report ({{}}))));
  const auto chunks = [] (guint8 second) {
    return kReceiverReport + Bytes{0x82, 202, 0, 5, 0, 0, 0, kFrom, 1, 1, 'x', 0, 0, 0, 0, second,
                                 1, 4, 'x', 'y', 'z', 'z', 0, 0};
  };
  fail_unless_equals_int (chunks (0).size (), 32);
  fail_unless (offer_bytes (session, chunks (kFrom)));
  fail_if (offer_bytes (session, chunks (kFrom + 1)));
  fail_unless_equals_uint64 (session.stat ("malformed"), 0);
}
GST_END_TEST;

/* ---- memory, time ---- */

/* A request about a stream, made without memory of C++'s. */
static GstBuffer *
about (guint32 stream, guint32 receiver)
{
  return with (gst_rtcp_buffer_new (100), GST_RTCP_TYPE_PSFB, receiver, stream);
}

GST_START_TEST (test_a_flood_of_receivers_takes_no_memory)
{
  if (!memory_can_end ())
    RANGECAST_SKIP ("operator new is somebody else's");
  Session session;
  session.push_rtp ();
  g_object_set (session.element, "max-receivers", 4096, nullptr);
  allocations_left = 0; /* else std::bad_alloc would cross the chain function */
  for (guint32 i = 0; i < 5000; i++)
    session.offer (about (kSender, 1000 + i), 0, nullptr);
  allocations_left = INT_MAX;
  fail_unless_equals_uint64 (session.stat ("receivers"), 4096);
}
GST_END_TEST;

/* Such a packet came now, not when the system's clock says: that is hours ahead. */
GST_START_TEST (test_a_packet_without_a_time_makes_nobody_look_silent)
{
  Session session;
  session.push_rtp ();
  g_object_set (session.element, "max-receivers", 1, nullptr);
  fail_unless (session.offer (receiver_report ({{}}, false, 1), 0));
  fail_unless (gst_harness_set_time (session.rtcp, 20 * GST_SECOND));
  fail_if (session.offer (receiver_report ({{}}, false, 2), GST_CLOCK_TIME_NONE));
  fail_unless (gst_harness_set_time (session.rtcp, 40 * GST_SECOND));
  fail_unless (session.offer (receiver_report ({{}}, false, 2), GST_CLOCK_TIME_NONE));
}
GST_END_TEST;

static guint
sources_of (GstElement *session)
{
  GstStructure *stats = nullptr;
  g_object_get (session, "stats", &stats, nullptr);
  const GValue *sources = gst_structure_get_value (stats, "source-stats");
  const auto array = static_cast<const GValueArray *> (g_value_get_boxed (sources));
  const guint count = array->n_values;
  gst_structure_free (stats);
  return count;
}

/* What it is all for: the session behind keeps a source for each SSRC. */
GST_START_TEST (test_a_session_behind_keeps_few_sources_in_a_flood)
{
  GstElement *bin = gst_bin_new (nullptr);
  GstElement *reports = gst_element_factory_make ("rtcpreports", nullptr);
  GstElement *session = gst_element_factory_make ("rtpsession", nullptr);
  gst_bin_add_many (GST_BIN (bin), reports, session, nullptr);
  fail_unless (gst_element_link_pads (reports, "src", session, "send_rtp_sink"));
  fail_unless (gst_element_link_pads (reports, "rtcp_src", session, "recv_rtcp_sink"));
  GstPad *rtp_in = gst_element_get_static_pad (reports, "sink");
  GstPad *rtcp_in = gst_element_get_static_pad (reports, "rtcp_sink");
  GstPad *rtp_out = gst_element_get_static_pad (session, "send_rtp_src");
  gst_element_add_pad (bin, gst_ghost_pad_new ("sink", rtp_in));
  gst_element_add_pad (bin, gst_ghost_pad_new ("rtcp_sink", rtcp_in));
  gst_element_add_pad (bin, gst_ghost_pad_new ("src", rtp_out));
  for (GstPad *pad : {rtp_in, rtcp_in, rtp_out})
    gst_object_unref (pad);
  GstHarness *rtp = gst_harness_new_with_element (bin, "sink", "src");
  GstHarness *rtcp = gst_harness_new_with_element (bin, "rtcp_sink", nullptr);
  gst_harness_set_src_caps_str (
      rtp, "application/x-rtp, media=video, clock-rate=90000, payload=96, ssrc=(uint)4660");
  gst_harness_set_src_caps_str (rtcp, "application/x-rtcp");
  GstBuffer *packet = gst_rtp_buffer_new_allocate (100, 0, 0);
  GstRTPBuffer mapped = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map (packet, GST_MAP_WRITE, &mapped);
  gst_rtp_buffer_set_ssrc (&mapped, kSender);
  gst_rtp_buffer_unmap (&mapped);
  GST_BUFFER_PTS (packet) = 0;
  gst_harness_push (rtp, packet);
  const guint before = sources_of (session);
  for (guint32 i = 0; i < 3000; i++) {
    const guint32 receiver = 100000 + i * 7919;
    GstBuffer *flood = receiver_report ({{.sender = i % 2 ? kSender : i}}, false, receiver);
    GSocketAddress *from = g_inet_socket_address_new_from_string ("10.0.0.9", guint16 (2000 + i));
    gst_buffer_add_net_address_meta (flood, from);
    g_object_unref (from);
    gst_harness_push (rtcp, with (flood, GST_RTCP_TYPE_SDES, receiver));
  }
  ck_assert_int_gt (sources_of (session), before); /* they do get there */
  fail_unless (sources_of (session) <= before + 64, "%u sources", sources_of (session));
  gst_harness_teardown (rtcp);
  gst_harness_teardown (rtp);
  gst_object_unref (bin);
}
GST_END_TEST;

static Suite *
rtcpreports_suite ()
{
  Suite *suite = suite_create ("rtcpreports");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_report_becomes_an_event_upstream);
  tcase_add_test (tc, test_packets_are_those_since_the_report_before);
  tcase_add_test (tc, test_round_trip_is_now_less_the_last_report_less_the_delay);
  tcase_add_test (tc, test_reports_about_other_streams_are_none);
  tcase_add_test (tc, test_bytes_that_are_no_rtcp_tell_nothing);
  tcase_add_test (tc, test_events_of_one_stream_do_not_reach_the_other);
  tcase_add_test (tc, test_rtcp_that_is_not_about_the_stream_does_not_pass);
  tcase_add_test (tc, test_a_request_about_the_stream_is_enough);
  tcase_add_test (tc, test_who_speaks_for_others_or_as_the_sender_does_not_pass);
  tcase_add_test (tc, test_one_who_is_known_does_not_pass_from_another_address);
  tcase_add_test (tc, test_a_flood_of_receivers_that_know_the_stream_leaves_room_for_others);
  tcase_add_test (tc, test_who_is_silent_for_half_a_minute_makes_room);
  tcase_add_test (tc, test_a_chunk_that_is_announced_but_not_there_is_not_read);
  tcase_add_test (tc, test_no_prefix_of_good_packets_is_read_beyond_its_end);
  tcase_add_test (tc, test_packets_that_lie_about_what_is_in_them_are_malformed);
  tcase_add_test (tc, test_packets_that_are_odd_but_whole_pass);
  tcase_add_test (tc, test_each_chunk_says_who_speaks);
  tcase_add_test (tc, test_a_flood_of_receivers_takes_no_memory);
  tcase_add_test (tc, test_a_packet_without_a_time_makes_nobody_look_silent);
  tcase_add_test (tc, test_a_session_behind_keeps_few_sources_in_a_flood);
  return suite;
}

GST_CHECK_MAIN (rtcpreports);
