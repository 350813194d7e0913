/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Payloader and depayloader together. */
#include "../rangecast-check.hpp"

#include <gst/rtp/rtp.h>

#include <algorithm>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr const char *kPlainRtpCaps =
    "application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE";

/* The packets of some access units of a rig, with the payloader's caps. */
struct Sent {
  std::vector<GstBuffer *> packets;
  std::vector<GstBuffer *> access_units;
  GstCaps *caps = nullptr;

  explicit Sent (
      const Rig &rig, int frames = 3, const char *launch = "rtpneighbourcodepay mtu=1400")
  {
    GstHarness *encoder = gst_harness_new_parse ("neighbourcodeenc profile=plain");
    gst_harness_set_src_caps (
        encoder, gstrange::make_range_caps (gstrange::make_info (rig, 25, 1)));
    GstHarness *h = gst_harness_new_parse (launch);
    gst_harness_set_src_caps (
        h, gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 25, 1)));
    for (int i = 0; i < frames; i++) {
      GstBuffer *coded =
          gst_harness_push_and_pull (encoder, make_frame_set (rig, i * GST_SECOND / 25));
      access_units.push_back (gst_buffer_ref (coded));
      fail_unless_equals_int (gst_harness_push (h, coded), GST_FLOW_OK);
    }
    while (GstBuffer *packet = gst_harness_try_pull (h))
      packets.push_back (packet);
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
    gst_harness_teardown (encoder);
  }
  ~Sent ()
  {
    for (GstBuffer *buffer : packets)
      gst_buffer_unref (buffer);
    for (GstBuffer *buffer : access_units)
      gst_buffer_unref (buffer);
    gst_caps_unref (caps);
  }
};

static std::vector<guint8>
bytes_of (GstBuffer *buffer)
{
  std::vector<guint8> bytes (gst_buffer_get_size (buffer));
  gst_buffer_extract (buffer, 0, bytes.data (), bytes.size ());
  return bytes;
}

static gsize
slice_bytes (std::span<const guint8> units)
{
  UnitReader reader (units);
  UnitHeader header;
  gsize bytes = 0;
  while (const auto unit = reader.next (header))
    bytes += header.type == guint8 (UnitType::kSlice) ? unit->size () : 0;
  return bytes;
}

static std::vector<guint8>
payload_of (GstBuffer *packet)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  fail_unless (gst_rtp_buffer_map (packet, GST_MAP_READ, &rtp));
  auto from = static_cast<const guint8 *> (gst_rtp_buffer_get_payload (&rtp));
  std::vector<guint8> bytes (from, from + gst_rtp_buffer_get_payload_len (&rtp));
  gst_rtp_buffer_unmap (&rtp);
  return bytes;
}

static GstHarness *
receiver (GstCaps *caps)
{
  GstHarness *h = gst_harness_new ("rtpneighbourcodedepay");
  gst_harness_set_src_caps (h, caps);
  return h;
}

static guint64
stat (GstHarness *h, const char *field)
{
  return stats_field (h->element, field, "unit-stats");
}

GST_START_TEST (test_access_units_come_back_byte_for_byte)
{
  const Sent sent (ring_rig (3));
  GstHarness *h = receiver (gst_caps_ref (sent.caps));
  for (GstBuffer *packet : sent.packets)
    gst_harness_push (h, gst_buffer_ref (packet));
  for (std::size_t i = 0; i < sent.access_units.size (); i++) {
    GstBuffer *received = gst_harness_pull (h);
    fail_unless_cmp (bytes_of (received), ==, bytes_of (sent.access_units[i]));
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (received), i * GST_SECOND / 25);
    gst_buffer_unref (received);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_any_one_lost_packet_costs_only_its_own_units)
{
  const Sent sent (ring_rig (1), 3);
  for (std::size_t lost = 0; lost < sent.packets.size (); lost++) {
    GstHarness *h = receiver (gst_caps_ref (sent.caps));
    gsize expected = 0, received = 0;
    for (GstBuffer *unit : sent.access_units)
      expected += slice_bytes (bytes_of (unit));
    for (std::size_t i = 0; i < sent.packets.size (); i++)
      if (i != lost)
        gst_harness_push (h, gst_buffer_ref (sent.packets[i]));
    gst_harness_push_event (h, gst_event_new_eos ());
    while (GstBuffer *buffer = gst_harness_try_pull (h)) {
      received += slice_bytes (bytes_of (buffer));
      gst_buffer_unref (buffer);
    }
    fail_unless_equals_int (received, expected - slice_bytes (payload_of (sent.packets[lost])));
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_rig_of_64_views_comes_in_band)
{
  Rig rig = ring_rig (64, 16, 12);
  const Sent sent (rig, 1);
  GstHarness *h = receiver (gst_caps_from_string (kPlainRtpCaps));
  for (GstBuffer *packet : sent.packets)
    gst_harness_push (h, gst_buffer_ref (packet));
  GstBuffer *received = gst_harness_pull (h);
  fail_unless_cmp (bytes_of (received), ==, bytes_of (sent.access_units[0]));
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  fail_unless_cmp (encode_rig (info.rig), ==, encode_rig (rig));
  fail_unless_equals_int (info.fps_n, 25);
  gst_caps_unref (caps);
  gst_buffer_unref (received);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A guard sends the caps again, with another SSRC, when the sender restarts: its rig in band
 * counts, not the one of a description from before. */
GST_START_TEST (test_rig_in_band_replaces_that_of_caps_which_come_again)
{
  const Sent described (ring_rig (1, 64, 48)),
      sent[2] = {Sent (ring_rig (2, 64, 48)), Sent (ring_rig (2, 64, 48))};
  GstHarness *h = gst_harness_new ("rtpneighbourcodedepay");
  for (int i = 0; i < 2; i++) {
    GstCaps *caps = gst_caps_copy (described.caps);
    gst_caps_set_simple (caps, "ssrc", G_TYPE_UINT, guint (i), nullptr);
    gst_harness_set_src_caps (h, caps);
    for (GstBuffer *packet : sent[i].packets)
      gst_harness_push (h, gst_buffer_ref (packet));
    GstCaps *out = gst_pad_get_current_caps (h->sinkpad);
    gstrange::RangeInfo info;
    fail_unless_ok (gstrange::parse_caps (out, info));
    fail_unless_equals_int (info.views (), 2);
    gst_caps_unref (out);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_nothing_comes_out_before_the_rig_is_known)
{
  const Sent sent (ring_rig (2), 2, "rtpneighbourcodepay mtu=1400 config-interval=0");
  GstHarness *h = receiver (gst_caps_from_string (kPlainRtpCaps));
  for (GstBuffer *packet : sent.packets)
    gst_harness_push (h, gst_buffer_ref (packet));
  fail_unless_equals_int (gst_harness_buffers_received (h), 0);
  fail_unless_equals_uint64 (stat (h, "without-rig"), 2);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_slices_of_views_that_the_rig_has_not_are_damaged_units)
{
  const Sent three (ring_rig (3), 2, "rtpneighbourcodepay mtu=1400 config-interval=0");
  const Sent two (ring_rig (2), 1);
  GstHarness *h = receiver (gst_caps_ref (two.caps));
  for (GstBuffer *packet : three.packets)
    gst_harness_push (h, gst_buffer_ref (packet));
  for (int i = 0; i < 2; i++) {
    GstBuffer *received = gst_harness_pull (h);
    const std::vector<guint8> bytes = bytes_of (received);
    UnitReader reader (bytes);
    UnitHeader header;
    unsigned views = 0;
    while (const auto unit = reader.next (header))
      views |= 1u << (*unit)[4];
    fail_unless_equals_int (views, 0b011);
    gst_buffer_unref (received);
  }
  ck_assert_uint_gt (stat (h, "bad-units"), 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_damaged_packets_are_counted_and_never_fatal)
{
  const Sent sent (ring_rig (2), 3);
  GstHarness *h = receiver (gst_caps_ref (sent.caps));
  GRand *random = g_rand_new_with_seed (7);
  for (int round = 0; round < 20; round++)
    for (GstBuffer *packet : sent.packets) {
      GstBuffer *bad = gst_buffer_copy_deep (packet);
      GstMapInfo map;
      gst_buffer_map (bad, &map, GST_MAP_READWRITE);
      for (int i = 0; i < 8; i++)
        map.data[g_rand_int_range (random, 12, gint32 (map.size))] ^=
            1 << g_rand_int_range (random, 0, 8);
      gst_buffer_unmap (bad, &map);
      gst_buffer_set_size (bad, g_rand_int_range (random, 13, gint32 (map.size) + 1));
      fail_unless_equals_int (gst_harness_push (h, bad), GST_FLOW_OK);
    }
  g_rand_free (random);
  ck_assert_uint_gt (stat (h, "bad-units"), 50);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_bad_rig_in_the_caps_is_one_error)
{
  GstHarness *h = gst_harness_new ("rtpneighbourcodedepay");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  GstCaps *caps = gst_caps_from_string (kPlainRtpCaps);
  gst_caps_set_simple (caps, "rig", G_TYPE_STRING, "AAAA", nullptr);
  gst_harness_set_src_caps (h, caps);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "rig");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Whether a packet holds slices. */
static bool
has_slices (GstBuffer *packet)
{
  const auto payload = payload_of (packet);
  UnitReader reader (payload);
  UnitHeader header;
  bool any = false;
  while (reader.next (header))
    any = any || header.type == guint8 (UnitType::kSlice);
  return any;
}

/* Large views, of which parts are lost, and small ones, each in a packet of its own. */
GST_START_TEST (test_an_access_unit_that_lacks_slices_is_no_key_unit_and_others_are)
{
  for (const int width : {160, 24}) {
    const Sent sent (ring_rig (2, width, width * 3 / 4), 3);
    if (width == 24) /* the rig's in front of the first, and one for each view */
      fail_unless_equals_int (int (sent.packets.size ()), 1 + 3 * 2);
    for (std::size_t lost = 0; lost < sent.packets.size (); lost++) {
      GstHarness *h = receiver (gst_caps_ref (sent.caps));
      for (std::size_t i = 0; i < sent.packets.size (); i++)
        if (i != lost)
          gst_harness_push (h, gst_buffer_ref (sent.packets[i]));
      gst_harness_push_event (h, gst_event_new_eos ());
      int buffers = 0;
      for (; GstBuffer *buffer = gst_harness_try_pull (h); buffers++) {
        const bool lacks = GST_BUFFER_PTS (buffer) == GST_BUFFER_PTS (sent.packets[lost]) &&
                           has_slices (sent.packets[lost]);
        fail_unless (lacks == GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT),
            "width %d: buffer %d without packet %zu", width, buffers, lost);
        gst_buffer_unref (buffer);
      }
      fail_unless_equals_int (buffers, 3);
      gst_harness_teardown (h);
    }
  }
}
GST_END_TEST;

/* Temporal prediction without key frame sets, from the second frame set on. */
GST_START_TEST (test_recording_that_begins_between_key_frame_sets_gets_the_rig_when_it_comes)
{
  const Rig rig = ring_rig (2, 64, 48);
  GstHarness *sender = gst_harness_new_parse (
      "neighbourcodeenc temporal=true ! rtpneighbourcodepay config-interval=1 mtu=60000");
  gst_harness_set_src_caps (sender, gstrange::make_range_caps (gstrange::make_info (rig, 25, 1)));
  GstHarness *h = nullptr;
  std::string rig_views; /* of each access unit */
  for (int i = 0; i < 60; i++) {
    gst_harness_push (sender, make_frame_set (rig, i * GST_SECOND / 25));
    if (i == 0)
      h = receiver (gst_pad_get_current_caps (sender->sinkpad));
    while (GstBuffer *packet = gst_harness_try_pull (sender))
      if (i > 0)
        gst_harness_push (h, packet);
      else
        gst_buffer_unref (packet);
    while (GstBuffer *received = gst_harness_try_pull (h)) {
      fail_unless (GST_BUFFER_FLAG_IS_SET (received, GST_BUFFER_FLAG_DELTA_UNIT));
      const auto bytes = bytes_of (received);
      UnitReader reader (bytes);
      UnitHeader header;
      int views = 0;
      while (reader.next (header))
        views += header.type == guint8 (UnitType::kRigView);
      rig_views += std::to_string (views);
      gst_buffer_unref (received);
    }
  }
  std::string expected (59, '0'); /* the first, and those of 1 s and 2 s */
  expected[0] = expected[24] = expected[49] = '2';
  fail_unless_equals_string (rig_views.c_str (), expected.c_str ());
  gst_harness_teardown (h);
  gst_harness_teardown (sender);
}
GST_END_TEST;

/* Memory is used again, but never while somebody holds a buffer, or a part of one. */
GST_START_TEST (test_access_units_keep_their_bytes_while_others_follow)
{
  const Sent sent (ring_rig (2), 12);
  GstHarness *h = receiver (gst_caps_ref (sent.caps));
  std::vector<GstBuffer *> kept, parts;
  std::vector<gconstpointer> places;
  for (GstBuffer *packet : sent.packets) {
    gst_harness_push (h, gst_buffer_ref (packet));
    while (GstBuffer *received = gst_harness_try_pull (h)) {
      GstMapInfo map;
      gst_buffer_map (received, &map, GST_MAP_READ);
      places.push_back (map.data);
      gst_buffer_unmap (received, &map);
      const std::size_t i = places.size () - 1;
      if (i < 5) {
        kept.push_back (received);
      } else if (i == 5) {
        parts.push_back (gst_buffer_copy_region (received, GST_BUFFER_COPY_MEMORY, 7, 100));
        gst_buffer_unref (received);
      } else {
        gst_buffer_unref (received);
      }
    }
  }
  fail_unless_equals_int (places.size (), 12);
  for (std::size_t i = 0; i < kept.size (); i++) {
    fail_unless_cmp (bytes_of (kept[i]), ==, bytes_of (sent.access_units[i]));
    gst_buffer_unref (kept[i]);
  }
  const auto whole = bytes_of (sent.access_units[5]);
  fail_unless (bytes_of (parts[0]) == std::vector (whole.begin () + 7, whole.begin () + 107));
  gst_buffer_unref (parts[0]);
  /* Those that nobody held lie in one place. */
  for (std::size_t i = 7; i < places.size (); i++)
    fail_unless (places[i] == places[i - 1] && places[i] != places[5]);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
rtpneighbourcodedepay_suite ()
{
  Suite *suite = suite_create ("rtpneighbourcodedepay");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_access_units_come_back_byte_for_byte);
  tcase_add_test (tc, test_access_units_keep_their_bytes_while_others_follow);
  tcase_add_test (tc, test_any_one_lost_packet_costs_only_its_own_units);
  tcase_add_test (tc, test_an_access_unit_that_lacks_slices_is_no_key_unit_and_others_are);
  tcase_add_test (tc, test_recording_that_begins_between_key_frame_sets_gets_the_rig_when_it_comes);
  tcase_add_test (tc, test_rig_of_64_views_comes_in_band);
  tcase_add_test (tc, test_rig_in_band_replaces_that_of_caps_which_come_again);
  tcase_add_test (tc, test_nothing_comes_out_before_the_rig_is_known);
  tcase_add_test (tc, test_slices_of_views_that_the_rig_has_not_are_damaged_units);
  tcase_add_test (tc, test_damaged_packets_are_counted_and_never_fatal);
  tcase_add_test (tc, test_bad_rig_in_the_caps_is_one_error);
  return suite;
}

GST_CHECK_MAIN (rtpneighbourcodedepay);
