/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <random>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <vector>

#include "../failing-memory.hpp"
#include "../rangecast-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static const std::string kNextVersion = "version " + std::to_string (kBitstreamVersion + 1);

/* Somebody who sends: what stands in the RTP header of his packets, and where they come from. */
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
  guint64 stat (const char *field)
  {
    GstStructure *stats;
    guint64 value = G_MAXUINT64;
    g_object_get (h->element, "stats", &stats, nullptr);
    gst_structure_get_uint64 (stats, field, &value);
    gst_structure_free (stats);
    return value;
  }
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

/* What a jitter buffer would be lost with: right SSRC, right numbers, before the right packets. */
GST_START_TEST (test_copies_of_the_good_stream_from_another_address_or_port_do_not_pass)
{
  Guard guard;
  Sender good;
  guard.send_many (good, 10);
  Sender address = good, port = good;
  address.address = "10.0.0.2";
  port.port++;
  fail_unless_equals_int (guard.send_many (address, 200), 0);
  fail_unless_equals_int (guard.send_many (port, 200), 0);
  fail_unless_equals_int (guard.send_many (good, 10), 10);
}
GST_END_TEST;

GST_START_TEST (test_damaged_packets_of_the_sender_do_not_pass_but_other_payload_types_do)
{
  Guard guard;
  Sender good;
  guard.send_many (good, 10);
  std::vector<guint8> damaged = slice_unit ();
  damaged[0] ^= 0x40;
  fail_unless_equals_int (guard.send (good, damaged), 0);
  damaged = slice_unit ();
  damaged.resize (20);
  fail_unless_equals_int (guard.send (good, damaged), 0);
  good.payload_type = 122; /* forward error correction */
  fail_unless_equals_int (guard.send (good, damaged), 1);
}
GST_END_TEST;

GST_START_TEST (test_a_second_sender_is_told_once_and_waits_until_the_first_is_silent)
{
  Guard guard;
  Sender earlier, later = {.ssrc = 2, .address = "10.0.0.2"};
  guard.send_many (earlier, 10);
  for (int i = 0; i < 300; i++) {
    fail_unless_equals_int (guard.send (later), 0);
    fail_unless_equals_int (guard.send (earlier), 1);
  }
  fail_unless_equals_int (guard.send_many (later, 300), 0);
  fail_unless_equals_int (guard.warnings ("Two senders"), 1);
  guard.time += GST_SECOND;
  fail_unless_equals_int (guard.send_many (later, 10), 10);
  fail_unless_equals_int (guard.send_many (earlier, 10), 0);
  fail_unless_equals_uint64 (guard.stat ("senders"), 2);
}
GST_END_TEST;

GST_START_TEST (test_a_sender_that_begins_again_from_its_port_passes_sooner_than_another)
{
  Guard guard;
  Sender sender, other = {.ssrc = 5, .address = "10.0.0.2"};
  guard.send_many (sender, 10);
  guard.time += 300 * GST_MSECOND;
  fail_unless_equals_int (guard.send_many (other, 10), 0);
  sender.ssrc = 77;
  sender.sequence = 60000;
  fail_unless_equals_int (guard.send_many (sender, 10), 10);
}
GST_END_TEST;

/* A relay, or two payloaders before one udpsink. */
GST_START_TEST (test_two_streams_from_one_port_do_not_take_turns)
{
  Guard guard;
  Sender one, two = {.ssrc = 2};
  guard.send_many (one, 10);
  for (int i = 0; i < 50; i++) {
    fail_unless_equals_int (guard.send_many (two, 10), 0);
    fail_unless_equals_int (guard.send_many (one, 10), 10);
  }
  fail_unless_equals_int (guard.warnings ("Two senders"), 1);
}
GST_END_TEST;

GST_START_TEST (test_without_a_timeout_nobody_takes_over)
{
  Guard guard;
  g_object_set (guard.h->element, "timeout", G_MAXUINT64, nullptr);
  Sender one, two = {.ssrc = 2, .address = "10.0.0.2"};
  guard.send_many (one, 10);
  guard.time += 3600 * GST_SECOND;
  fail_unless_equals_int (guard.send_many (two, 10), 0);
}
GST_END_TEST;

/* A flood of pieces of a good stream, from before the stream begins. */
GST_START_TEST (test_sound_packets_out_of_order_are_no_sender)
{
  Guard guard;
  std::minstd_rand random (2);
  Sender flood = {.address = "10.0.0.9"}, good;
  for (int i = 0; i < 2000; i++) {
    flood.sequence = guint16 (random () % 256);
    fail_unless_equals_int (guard.send (flood), 0);
  }
  int passed = 0;
  for (int i = 0; i < 10; i++) {
    flood.sequence = guint16 (random () % 256);
    fail_unless_equals_int (guard.send (flood), 0);
    passed += guard.send (good);
  }
  fail_unless_equals_int (passed, 10);
}
GST_END_TEST;

GST_START_TEST (test_another_version_is_told_once_and_does_not_pass)
{
  Guard guard;
  Sender newer = {.ssrc = 9, .address = "10.0.0.3"}, good;
  std::vector<guint8> unit = slice_unit ();
  unit[0] = guint8 ((kBitstreamVersion + 1) << 4 | (unit[0] & 15));
  for (int i = 0; i < 100; i++)
    fail_unless_equals_int (guard.send (newer, unit), 0);
  fail_unless_equals_int (guard.send_many (good, 10), 10);
  for (int i = 0; i < 100; i++)
    fail_unless_equals_int (guard.send (newer, unit), 0);
  fail_unless_equals_int (guard.warnings (kNextVersion.c_str ()), 1);
}
GST_END_TEST;

GST_START_TEST (test_packets_that_do_not_say_where_they_come_from_are_told_apart_by_ssrc)
{
  Guard guard;
  Sender good = {.address = nullptr}, other = {.ssrc = 2, .address = nullptr};
  fail_unless_equals_int (guard.send_many (good, 10), 10);
  other.payload_type = 97;
  fail_unless_equals_int (guard.send (other, {1, 2, 3}), 0);
  fail_unless_equals_int (guard.send_many (good, 10), 10);
}
GST_END_TEST;

GST_START_TEST (test_plays_twice_and_forgets_its_sender)
{
  GstElement *element = gst_element_factory_make ("rtpneighbourcodeguard", nullptr);
  for (guint32 ssrc : {1, 2}) {
    GstHarness *h = gst_harness_new_with_element (element, "sink", "src");
    gst_harness_set_src_caps_str (h, "application/x-rtp");
    Sender sender = {.ssrc = ssrc};
    for (int i = 0; i < 8; i++, sender.sequence++)
      gst_harness_push (h, make_packet (sender, slice_unit (), i));
    fail_unless_equals_int (gst_harness_buffers_received (h), 8);
    gst_harness_teardown (h);
    gst_element_set_state (element, GST_STATE_NULL);
  }
  gst_object_unref (element);
}
GST_END_TEST;

/* As a rig of one picture in half a second, of whose packets the kernel lets a sample through. */
GST_START_TEST (test_a_second_sender_of_few_packets_is_told_after_two_seconds)
{
  Guard guard;
  Sender good, other = {.ssrc = 2, .address = "10.0.0.2"};
  guard.send_many (good, 10);
  for (int i = 0; i < 4; i++) {
    fail_unless_equals_int (guard.warnings ("Two senders"), 0);
    other.sequence = guint16 (other.sequence + 8);
    fail_unless_equals_int (guard.send (other), 0);
    guard.time += 240 * GST_MSECOND;
    for (int k = 0; k < 3; k++, guard.time += 240 * GST_MSECOND)
      fail_unless_equals_int (guard.send (good), 1);
  }
  fail_unless_equals_int (guard.send (other), 0);
  fail_unless_equals_int (guard.warnings ("00000002 from 10.0.0.2:5000, accepting those of "
                                          "00000001 from 10.0.0.1:5000"),
      1);
}
GST_END_TEST;

GST_START_TEST (test_another_version_beside_a_sender_is_told_though_most_of_it_is_kept_out)
{
  Guard guard;
  Sender good, newer = {.ssrc = 9, .address = "10.0.0.3"}, copy = {.address = "10.0.0.4"};
  std::vector<guint8> unit = slice_unit ();
  unit[0] = guint8 ((kBitstreamVersion + 1) << 4 | (unit[0] & 15));
  guard.send_many (good, 10);
  const auto play = [&] (Sender &sender) {
    for (int i = 0; i < 60; i++, guard.time += 50 * GST_MSECOND) {
      fail_unless_equals_int (guard.send (good), 1);
      sender.sequence = guint16 (sender.sequence + 5);
      fail_unless_equals_int (guard.send (sender, unit), 0);
    }
  };
  play (copy); /* damaged copies of the good stream are no version, ... */
  Sender other = {.ssrc = 77, .address = "10.0.0.5"};
  for (int i = 0; i < 60; i++, guard.time += 50 * GST_MSECOND) { /* ... nor are those of another */
    fail_unless_equals_int (guard.send (good), 1);
    fail_unless_equals_int (guard.send (other, i % 2 ? unit : slice_unit ()), 0);
  }
  fail_unless_equals_int (guard.warnings (kNextVersion.c_str ()), 0);
  guard.time += 10 * GST_SECOND;
  play (newer);
  fail_unless_equals_int (guard.warnings (kNextVersion.c_str ()), 1);
}
GST_END_TEST;

GST_START_TEST (test_packets_that_are_not_sound_are_told_once_with_how_many)
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
  for (int i = 0; i < 200; i++) { /* beside a good stream they are no matter */
    send (1);
    fail_unless_equals_int (guard.send (good), 1);
  }
  fail_unless_equals_int (guard.warnings ("--key"), 0);
}
GST_END_TEST;

/* What is no RTP has no SSRC: it is not that of a sender whose SSRC is 0. */
GST_START_TEST (test_bytes_that_are_no_rtp_do_not_pass_as_those_of_ssrc_0)
{
  Guard guard;
  Sender good = {.ssrc = 0, .address = nullptr};
  guard.send_many (good, 10);
  gst_harness_push (guard.h, gst_buffer_new_memdup ("no RTP", 6));
  fail_unless_equals_int (gst_harness_buffers_received (guard.h), 10);
}
GST_END_TEST;

GST_START_TEST (test_a_stream_begins_in_a_flood_of_sound_packets_of_ever_new_senders)
{
  Guard guard;
  Sender flood = {.ssrc = 1000, .address = "10.0.0.9"}, good;
  int passed = 0;
  for (int i = 0; i < 10; i++) {
    for (int k = 0; k < 500; k++, flood.ssrc++)
      fail_unless_equals_int (guard.send (flood), 0);
    passed += guard.send (good);
  }
  fail_unless_equals_int (passed, 10);
}
GST_END_TEST;

/* As from an application's source: it came now, and not when the system's clock says, which is
 * hours ahead of the sender. */
GST_START_TEST (test_packets_without_a_time_do_not_take_over)
{
  Guard guard;
  Sender good, other = {.ssrc = 2, .address = "10.0.0.2"};
  fail_unless_equals_int (guard.send_many (good, 10), 10);
  fail_unless (gst_harness_set_time (guard.h, guard.time));
  for (int i = 0; i < 10; i++) {
    other.sequence++;
    gst_harness_push (guard.h, make_packet (other, slice_unit (), GST_CLOCK_TIME_NONE));
  }
  fail_unless_equals_int (gst_harness_buffers_received (guard.h), 10);
  fail_unless_equals_int (guard.send_many (good, 10), 10);
}
GST_END_TEST;

/* Else std::bad_alloc would cross the chain function. Payloads are made before. */
GST_START_TEST (test_without_memory_the_sender_passes_and_strangers_do_not)
{
  if (!memory_can_end ())
    RANGECAST_SKIP ("operator new is somebody else's");
  Guard guard;
  Sender good, other = {.ssrc = 2, .address = "10.0.0.2"}, foreign = {.ssrc = 3};
  const std::vector<guint8> sound = slice_unit (), unsound (20, 0x80);
  std::vector<guint8> damaged = slice_unit (), newer = slice_unit ();
  damaged[6] = 255; /* depth bits */
  newer[0] = 0x30 | (newer[0] & 15);
  const std::vector<guint8> *payloads[] = {&sound, &unsound, &damaged, &newer};
  int passed = 0;
  allocations_left = 0;
  for (int i = 0; i < 200; i++) {
    passed += guard.send (good, sound);
    for (const std::vector<guint8> *payload : payloads) {
      guard.send (other, *payload);
      guard.send (foreign, *payload);
    }
  }
  allocations_left = INT_MAX;
  fail_unless_equals_int (passed, 200);
  fail_unless_equals_int (guard.warnings ("Two senders"), 1);
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
  tcase_add_test (tc, test_copies_of_the_good_stream_from_another_address_or_port_do_not_pass);
  tcase_add_test (tc, test_damaged_packets_of_the_sender_do_not_pass_but_other_payload_types_do);
  tcase_add_test (tc, test_a_second_sender_is_told_once_and_waits_until_the_first_is_silent);
  tcase_add_test (tc, test_a_sender_that_begins_again_from_its_port_passes_sooner_than_another);
  tcase_add_test (tc, test_two_streams_from_one_port_do_not_take_turns);
  tcase_add_test (tc, test_without_a_timeout_nobody_takes_over);
  tcase_add_test (tc, test_sound_packets_out_of_order_are_no_sender);
  tcase_add_test (tc, test_another_version_is_told_once_and_does_not_pass);
  tcase_add_test (tc, test_packets_that_do_not_say_where_they_come_from_are_told_apart_by_ssrc);
  tcase_add_test (tc, test_plays_twice_and_forgets_its_sender);
  tcase_add_test (tc, test_a_second_sender_of_few_packets_is_told_after_two_seconds);
  tcase_add_test (tc, test_another_version_beside_a_sender_is_told_though_most_of_it_is_kept_out);
  tcase_add_test (tc, test_packets_that_are_not_sound_are_told_once_with_how_many);
  tcase_add_test (tc, test_bytes_that_are_no_rtp_do_not_pass_as_those_of_ssrc_0);
  tcase_add_test (tc, test_a_stream_begins_in_a_flood_of_sound_packets_of_ever_new_senders);
  tcase_add_test (tc, test_packets_without_a_time_do_not_take_over);
  tcase_add_test (tc, test_without_memory_the_sender_passes_and_strangers_do_not);
  return suite;
}

GST_CHECK_MAIN (rtpneighbourcodeguard);
