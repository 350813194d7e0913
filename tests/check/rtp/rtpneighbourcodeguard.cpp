/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <random>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <vector>

#include "../rangecast-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* A sender: the RTP header of its packets, and its address. */
struct Sender {
  guint32 ssrc = 1;
  guint16 sequence = 100;
  guint8 payload_type = 96;
  const char *address = "10.0.0.1";
  guint16 port = 5000;
};

static std::vector<guint8>
slice_unit ()
{
  std::vector<guint8> unit (kSliceHeaderSize);
  SliceHeader header;
  header.depth_bits = 12;
  header.colour_bits = 8;
  write_slice_header (header, unit.size (), unit.data ());
  return unit;
}

static GstBuffer *
make_packet (const Sender &from, const std::vector<guint8> &payload, GstClockTime time)
{
  GstBuffer *buffer = gst_rtp_buffer_new_allocate (payload.size (), 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map (buffer, GST_MAP_WRITE, &rtp);
  gst_rtp_buffer_set_ssrc (&rtp, from.ssrc);
  gst_rtp_buffer_set_seq (&rtp, from.sequence);
  gst_rtp_buffer_set_payload_type (&rtp, from.payload_type);
  std::copy (
      payload.begin (), payload.end (), static_cast<guint8 *> (gst_rtp_buffer_get_payload (&rtp)));
  gst_rtp_buffer_unmap (&rtp);
  GST_BUFFER_PTS (buffer) = GST_BUFFER_DTS (buffer) = time;
  if (from.address) {
    GSocketAddress *address = g_inet_socket_address_new_from_string (from.address, from.port);
    gst_buffer_add_net_address_meta (buffer, address);
    g_object_unref (address);
  }
  return buffer;
}

struct Guard {
  GstHarness *h = gst_harness_new ("rtpneighbourcodeguard");
  GstBus *bus = gst_bus_new ();
  GstClockTime time = 0;

  Guard ()
  {
    gst_element_set_bus (h->element, bus);
    gst_harness_set_src_caps_str (h, "application/x-rtp,media=video,clock-rate=90000,"
                                     "encoding-name=X-NEIGHBOUR-CODE,payload=96");
  }
  ~Guard ()
  {
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
  }
  /* One packet, its sequence number one up. @return how many came out for it */
  int send (Sender &from, const std::vector<guint8> &payload = slice_unit ())
  {
    time += GST_MSECOND;
    from.sequence++;
    const guint before = gst_harness_buffers_received (h);
    fail_unless_equals_int (gst_harness_push (h, make_packet (from, payload, time)), GST_FLOW_OK);
    return int (gst_harness_buffers_received (h) - before);
  }
  int send_many (Sender &from, int packets)
  {
    int passed = 0;
    for (int i = 0; i < packets; i++)
      passed += send (from);
    return passed;
  }
  guint64 stat (const char *field) { return stats_field (h->element, field); }
  int warnings (const char *part)
  {
    int count = 0;
    while (GstMessage *message = gst_bus_pop (bus)) {
      if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_WARNING) {
        GError *error = nullptr;
        gst_message_parse_warning (message, &error, nullptr);
        count += strstr (error->message, part) != nullptr;
        g_error_free (error);
      }
      gst_message_unref (message);
    }
    return count;
  }
};

GST_START_TEST (test_a_sender_passes_whole_from_its_first_packet_on)
{
  Guard guard;
  Sender sender;
  fail_unless_equals_int (guard.send_many (sender, 100), 100);
  for (int i = 0; i < 100; i++) {
    GstBuffer *packet = gst_harness_pull (guard.h);
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    fail_unless (gst_rtp_buffer_map (packet, GST_MAP_READ, &rtp));
    fail_unless_equals_int (gst_rtp_buffer_get_seq (&rtp), 101 + i);
    gst_rtp_buffer_unmap (&rtp);
    gst_buffer_unref (packet);
  }
  fail_unless_equals_uint64 (guard.stat ("passed"), 100);
  fail_unless_equals_uint64 (guard.stat ("foreign"), 0);
}
GST_END_TEST;

GST_START_TEST (test_random_bytes_and_other_codecs_never_pass)
{
  Guard guard;
  std::minstd_rand random (1);
  Sender vp8 = {.ssrc = 7, .address = "10.0.0.2"};
  for (int i = 0; i < 3000; i++) {
    std::vector<guint8> bytes (1 + random () % 1400);
    for (guint8 &byte : bytes)
      byte = guint8 (random ());
    fail_unless_equals_int (guard.send (vp8, bytes), 0);
    GstBuffer *raw = gst_buffer_new_memdup (bytes.data (), bytes.size ());
    gst_harness_push (guard.h, raw);
  }
  fail_unless_equals_int (gst_harness_buffers_received (guard.h), 0);
  fail_unless_equals_uint64 (guard.stat ("foreign"), 6000);
}
GST_END_TEST;

GST_START_TEST (test_fec_and_retransmissions_of_the_sender_pass)
{
  Guard guard;
  Sender good;
  guard.send_many (good, 10);
  good.payload_type = 122;
  fail_unless_equals_int (guard.send (good, {1, 2, 3}), 1);
  Sender again = {.ssrc = 77, .payload_type = 97}, other = again;
  other.address = "10.0.0.2";
  fail_unless_equals_int (guard.send (again, {0, 101, 1, 2}), 1);
  fail_unless_equals_int (guard.send (other, {0, 101, 1, 2}), 0);
}
GST_END_TEST;

/* SRTP's senders change it when their sequence numbers wrap. */
GST_START_TEST (test_the_next_ssrc_of_a_sender_passes_immediately)
{
  Guard guard;
  Sender sender = {.ssrc = G_MAXUINT32}, other = {.ssrc = 0, .address = "10.0.0.2"};
  guard.send_many (sender, 10);
  fail_unless_equals_int (guard.send_many (other, 5), 0);
  sender.ssrc++;
  fail_unless_equals_int (guard.send_many (sender, 10), 10);
  fail_unless_equals_uint64 (guard.stat ("passed"), 20);
  fail_unless_equals_uint64 (guard.stat ("foreign"), 5);
  GstCaps *caps = gst_pad_get_current_caps (guard.h->sinkpad);
  guint ssrc = 1;
  fail_unless (gst_structure_get_uint (gst_caps_get_structure (caps, 0), "ssrc", &ssrc));
  gst_caps_unref (caps);
  fail_unless_equals_int (int (ssrc), 0);
}
GST_END_TEST;

GST_START_TEST (test_of_two_senders_the_second_waits_until_the_first_is_silent_and_is_reported_once)
{
  Guard guard;
  Sender earlier, later = {.ssrc = 2, .address = "10.0.0.2"};
  guard.send_many (earlier, 10);
  for (int i = 0; i < 50; i++, guard.time += 50 * GST_MSECOND) {
    fail_unless_equals_int (guard.send_many (later, 3), 0);
    fail_unless_equals_int (guard.send (earlier), 1);
    if (i == 30)
      fail_unless_equals_int (guard.warnings ("Two senders"), 0);
  }
  fail_unless_equals_int (guard.warnings ("00000002 from 10.0.0.2:5000, accepting those of SSRC "
                                          "00000001 from 10.0.0.1:5000"),
      1);
  guard.time += 500 * GST_MSECOND;
  fail_unless_equals_int (guard.send_many (later, 10), 10);
  fail_unless_equals_int (guard.send_many (earlier, 10), 0);
  fail_unless_equals_uint64 (guard.stat ("senders"), 2);
}
GST_END_TEST;

GST_START_TEST (test_a_restarted_sender_passes_after_half_a_second_and_is_no_second_one)
{
  Guard guard;
  Sender sender;
  guard.send_many (sender, 10);
  sender.ssrc = 77;
  sender.sequence = 60000;
  sender.port++;
  fail_unless_equals_int (guard.send_many (sender, 9), 0);
  guard.time += 500 * GST_MSECOND;
  fail_unless_equals_int (guard.send_many (sender, 10), 10);
  guard.time += 3 * GST_SECOND;
  fail_unless_equals_int (guard.send_many (sender, 10), 10);
  fail_unless_equals_int (guard.warnings ("Two senders"), 0);
}
GST_END_TEST;

GST_START_TEST (test_invalid_packets_without_a_sender_are_reported_once)
{
  Guard guard;
  std::minstd_rand random (3);
  Sender hidden = {.ssrc = 3, .address = "10.0.0.2"}, good;
  const auto send = [&] (int packets) {
    for (int i = 0; i < packets; i++, guard.time += 50 * GST_MSECOND) {
      std::vector<guint8> bytes (200);
      for (guint8 &byte : bytes)
        byte = guint8 (random ());
      bytes[0] = 0; /* of no version */
      fail_unless_equals_int (guard.send (hidden, bytes), 0);
    }
  };
  send (50); /* 2.5 s */
  fail_unless_equals_int (guard.warnings ("--key"), 0);
  send (50);
  fail_unless_equals_int (guard.warnings ("60 invalid packets and no valid one"), 1);
  send (500);
  fail_unless_equals_int (guard.warnings ("--key"), 0);
  guard.send_many (good, 10);
  for (int i = 0; i < 200; i++) { /* with a sender they do not matter */
    send (1);
    fail_unless_equals_int (guard.send (good), 1);
  }
  fail_unless_equals_int (guard.warnings ("--key"), 0);
}
GST_END_TEST;

static Suite *
rtpneighbourcodeguard_suite ()
{
  Suite *suite = suite_create ("rtpneighbourcodeguard");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_a_sender_passes_whole_from_its_first_packet_on);
  tcase_add_test (tc, test_random_bytes_and_other_codecs_never_pass);
  tcase_add_test (tc, test_fec_and_retransmissions_of_the_sender_pass);
  tcase_add_test (tc, test_the_next_ssrc_of_a_sender_passes_immediately);
  tcase_add_test (
      tc, test_of_two_senders_the_second_waits_until_the_first_is_silent_and_is_reported_once);
  tcase_add_test (tc, test_a_restarted_sender_passes_after_half_a_second_and_is_no_second_one);
  tcase_add_test (tc, test_invalid_packets_without_a_sender_are_reported_once);
  return suite;
}

GST_CHECK_MAIN (rtpneighbourcodeguard);
