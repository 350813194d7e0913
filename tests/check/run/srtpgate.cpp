/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* srtpdec behind its gate: who has the key gets through, and nobody else costs memory. */
#include "run/srtp-gate.hpp"

#include <gst/rtp/rtp.h>

#include "../rangecast-check.hpp"

/* A srtpenc with a key. */
struct Encrypter {
  GstHarness *h;

  explicit Encrypter (guint8 first_byte)
  {
    GstElement *element = gst_element_factory_make ("srtpenc", nullptr);
    GstBuffer *key = key_of (first_byte);
    g_object_set (element, "key", key, nullptr);
    gst_buffer_unref (key);
    h = gst_harness_new_with_element (element, "rtp_sink_0", "rtp_src_0");
    gst_object_unref (element);
    gst_harness_set_src_caps_str (
        h, "application/x-rtp,media=video,clock-rate=90000,payload=96");
  }
  ~Encrypter () { gst_harness_teardown (h); }
  Encrypter (const Encrypter &) = delete;

  static GstBuffer *key_of (guint8 first_byte)
  {
    guint8 bytes[30] = {first_byte, 2, 3};
    return gst_buffer_new_memdup (bytes, sizeof bytes);
  }
  GstBuffer *packet (guint32 ssrc, guint16 sequence)
  {
    GstBuffer *buffer = gst_rtp_buffer_new_allocate (40, 0, 0);
    gst_buffer_memset (buffer, 12, 0, 40);
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    gst_rtp_buffer_map (buffer, GST_MAP_WRITE, &rtp);
    gst_rtp_buffer_set_ssrc (&rtp, ssrc);
    gst_rtp_buffer_set_seq (&rtp, sequence);
    gst_rtp_buffer_set_payload_type (&rtp, 96);
    gst_rtp_buffer_unmap (&rtp);
    return gst_harness_push_and_pull (h, buffer);
  }
  /* Sends until the sequence number has started over so often, in steps that count as losses. */
  void wrap (guint32 ssrc, int times)
  {
    for (gint64 i = 0; i < gint64 (times) << 16; i += 0x4000)
      gst_buffer_unref (packet (ssrc, guint16 (i)));
  }
};

struct Decrypter {
  GstHarness *h;

  Decrypter ()
  {
    GstElement *element = gst_element_factory_make ("srtpdec", nullptr);
    GstBuffer *key = Encrypter::key_of (1);
    fail_unless (add_srtp_gate (element, key));
    gst_buffer_unref (key);
    h = gst_harness_new_with_element (element, "rtp_sink", "rtp_src");
    gst_object_unref (element);
    gst_harness_set_src_caps_str (h, "application/x-srtp");
  }
  ~Decrypter () { gst_harness_teardown (h); }
  Decrypter (const Decrypter &) = delete;

  bool opens (GstBuffer *packet)
  {
    fail_unless_equals_int (gst_harness_push (h, packet), GST_FLOW_OK);
    GstBuffer *out = gst_harness_try_pull (h);
    if (out)
      gst_buffer_unref (out);
    return out != nullptr;
  }
  /* Those that a sender sends until one opens: not all are tried. */
  int opens_after (Encrypter &sender, guint32 ssrc)
  {
    for (int i = 1; i < 1000; i++) {
      if (opens (sender.packet (ssrc, guint16 (i))))
        return i;
      g_usleep (1000);
    }
    return -1;
  }
  /* The same for a sender who has sent before, at about 240 a second, from `sequence` on. */
  int opens_late (Encrypter &sender, guint32 ssrc, guint16 sequence, int most)
  {
    for (int i = 1; i <= most; i++) {
      if (opens (sender.packet (ssrc, guint16 (sequence + i))))
        return i;
      g_usleep (4000);
    }
    return -1;
  }
  guint streams ()
  {
    GstStructure *stats = nullptr;
    g_object_get (h->element, "stats", &stats, nullptr);
    const guint count = gst_value_array_get_size (gst_structure_get_value (stats, "streams"));
    gst_structure_free (stats);
    return count;
  }
};

static bool
has_srtp ()
{
  GstElement *element = gst_element_factory_make ("srtpdec", nullptr);
  const bool has = element != nullptr;
  gst_clear_object (&element);
  return has;
}
#define NEED_SRTP                                                                                  \
  if (!has_srtp ())                                                                                \
  RANGECAST_SKIP ("no srtpdec")

GST_START_TEST (test_who_has_the_key_passes_from_the_first_packet_on)
{
  NEED_SRTP;
  Encrypter right (1), wrong (9);
  Decrypter decrypter;
  for (guint16 i = 0; i < 100; i++) {
    fail_unless (decrypter.opens (right.packet (7, i)));
    fail_if (decrypter.opens (wrong.packet (8, i)));
    fail_if (decrypter.opens (wrong.packet (7, i))); /* under the good one's SSRC */
  }
  fail_unless_equals_int (decrypter.streams (), 1);
}
GST_END_TEST;

GST_START_TEST (test_a_flood_of_ssrcs_makes_no_streams_and_keeps_nobody_out)
{
  NEED_SRTP;
  Encrypter right (1), wrong (9), late (1);
  Decrypter decrypter;
  fail_unless (decrypter.opens (right.packet (7, 1)));
  for (guint32 i = 0; i < 3000; i++)
    fail_if (decrypter.opens (wrong.packet (1000 + i, 1)));
  fail_unless_equals_int (decrypter.streams (), 1);
  fail_unless (decrypter.opens (right.packet (7, 2)));
  ck_assert_int_gt (decrypter.opens_after (late, 8), 0);
  fail_unless_equals_int (decrypter.streams (), 2);
}
GST_END_TEST;

GST_START_TEST (test_bytes_that_are_no_packets_do_not_pass)
{
  NEED_SRTP;
  Decrypter decrypter;
  GRand *random = g_rand_new_with_seed (1);
  for (int i = 0; i < 2000; i++) {
    guint8 bytes[64];
    for (guint8 &byte : bytes)
      byte = guint8 (g_rand_int (random));
    fail_if (decrypter.opens (gst_buffer_new_memdup (bytes, 1 + g_rand_int (random) % 64)));
  }
  g_rand_free (random);
  fail_unless_equals_int (decrypter.streams (), 0);
}
GST_END_TEST;

/* A camera host that begins again has another SSRC. */
GST_START_TEST (test_the_streams_of_genuine_senders_are_bounded_and_those_who_send_go_on)
{
  NEED_SRTP;
  Encrypter good (1);
  Decrypter decrypter;
  for (int i = 65530; i < 65550; i++) /* its sequence numbers start over */
    fail_unless (decrypter.opens (good.packet (7, guint16 (i))));
  for (guint32 i = 0; i < 300; i++) {
    ck_assert_int_gt (decrypter.opens_after (good, 1000 + i), 0);
    fail_unless (decrypter.opens (good.packet (7, guint16 (100 + i))));
  }
  fail_unless (decrypter.streams () <= 257, "%u streams", decrypter.streams ());
}
GST_END_TEST;

/* How many packets it takes: 400 roll-over counters are tried a second. */
static void
check_late (int wraps, int most)
{
  Encrypter sender (1);
  Decrypter decrypter;
  sender.wrap (7, wraps);
  const int after = decrypter.opens_late (sender, 7, 100, most);
  fail_unless (after > 0, "wrapped %d times: none of %d packets opens", wraps, most);
  for (int i = 0; i < 70000; i += 500)
    fail_unless (decrypter.opens (sender.packet (7, guint16 (100 + after + 1 + i))), "%d", i);
  fail_unless_equals_int (decrypter.streams (), 1);
}

GST_START_TEST (test_a_receiver_that_comes_after_the_sequence_numbers_started_over_opens_the_stream)
{
  NEED_SRTP;
  check_late (0, 1);
  check_late (1, 3);
  check_late (3, 3);
  check_late (300, 600);
}
GST_END_TEST;

GST_START_TEST (test_a_flood_of_strangers_does_not_keep_out_a_sender_of_unknown_roll_over)
{
  NEED_SRTP;
  Encrypter right (1), wrong (9);
  Decrypter decrypter;
  right.wrap (7, 40);
  guint32 stranger = 1000;
  int after = -1;
  for (int i = 0; i < 3000 && after < 0; i++) {
    for (int k = 0; k < 20; k++) /* an SSRC each; and three that go on */
      fail_if (decrypter.opens (wrong.packet (stranger++, 1)));
    for (guint32 k = 0; k < 3; k++)
      fail_if (decrypter.opens (wrong.packet (10 + k, guint16 (i))));
    if (decrypter.opens (right.packet (7, guint16 (i))))
      after = i;
    g_usleep (2000);
  }
  ck_assert_int_ge (after, 0);
  fail_unless_equals_int (decrypter.streams (), 1);
}
GST_END_TEST;

GST_START_TEST (test_a_wrong_key_opens_with_no_roll_over)
{
  NEED_SRTP;
  Encrypter wrong (9);
  Decrypter decrypter;
  wrong.wrap (7, 3);
  fail_unless_equals_int (decrypter.opens_late (wrong, 7, 100, 400), -1);
  fail_unless_equals_int (decrypter.streams (), 0);
}
GST_END_TEST;

GST_START_TEST (test_sequence_numbers_may_start_over_while_the_roll_over_is_looked_for)
{
  NEED_SRTP;
  {
    Encrypter sender (1);
    Decrypter decrypter;
    sender.wrap (7, 60);
    for (int i = 0; i < 0x10000; i += 0x4000) /* and on to the end */
      gst_buffer_unref (sender.packet (7, guint16 (i)));
    ck_assert_int_gt (decrypter.opens_late (sender, 7, 65534, 400), 2);
  }
  Encrypter sender (1);
  Decrypter decrypter;
  fail_unless (decrypter.opens (sender.packet (7, 65534)));
  GstBuffer *late = sender.packet (7, 65535);
  fail_unless (decrypter.opens (sender.packet (7, 0)));
  fail_unless (decrypter.opens (late));
  fail_unless (decrypter.opens (sender.packet (7, 1)));
}
GST_END_TEST;

/* As many packets lost as make the receiver guess wrong; meanwhile somebody sends old ones again.
 */
GST_START_TEST (test_a_known_sender_is_found_again_after_a_long_loss_and_replays_are_not)
{
  NEED_SRTP;
  Encrypter sender (1);
  Decrypter decrypter;
  sender.wrap (7, 2);
  GstBuffer *old[8];
  for (guint16 i = 0; i < 8; i++)
    old[i] = sender.packet (7, 100 + i);
  ck_assert_int_gt (decrypter.opens_late (sender, 7, 400, 20), 0);
  for (int i = 500; i < 40000; i += 0x4000)
    gst_buffer_unref (sender.packet (7, guint16 (i)));
  int after = -1;
  for (int i = 0; i < 2000 && after < 0; i++) {
    fail_if (decrypter.opens (gst_buffer_copy_deep (old[i % 8])));
    if (decrypter.opens (sender.packet (7, guint16 (40000 + i))))
      after = i;
    g_usleep (4000);
  }
  ck_assert_int_ge (after, 0);
  for (GstBuffer *buffer : old)
    fail_if (decrypter.opens (buffer));
  fail_unless (decrypter.opens (sender.packet (7, guint16 (40000 + after + 1))));
}
GST_END_TEST;

/* It has to be silent for ten seconds first: until then its packets could be a replay. */
GST_START_TEST (test_a_sender_that_begins_again_with_the_same_ssrc_is_found)
{
  NEED_SRTP;
  Encrypter before (1), again (1);
  Decrypter decrypter;
  before.wrap (7, 3);
  ck_assert_int_gt (decrypter.opens_late (before, 7, 100, 20), 0);
  const gint64 began_us = g_get_monotonic_time ();
  const int after = decrypter.opens_late (again, 7, 100, 20000);
  ck_assert_int_gt (after, 0);
  ck_assert_int_gt (g_get_monotonic_time () - began_us, 9'000'000);
  fail_unless (decrypter.opens (again.packet (7, guint16 (100 + after + 1))));
  /* Was it a replay, then its true sender gets the stream back, and the replay does not. */
  int back = -1;
  guint16 i = 0;
  for (; i < 2000 && back < 0; i++) {
    decrypter.opens (again.packet (7, guint16 (100 + after + 2 + i)));
    if (decrypter.opens (before.packet (7, guint16 (200 + i))))
      back = i;
    g_usleep (4000);
  }
  ck_assert_int_gt (back, 0);
  fail_if (decrypter.opens (again.packet (7, guint16 (100 + after + 2 + i))));
  fail_unless (decrypter.opens (before.packet (7, guint16 (200 + i))));
}
GST_END_TEST;

/* srtpdec was made to forget, and with the streams what it had seen of them. */
GST_START_TEST (test_replays_stay_out_when_senders_were_forgotten)
{
  NEED_SRTP;
  Encrypter good (1);
  Decrypter decrypter;
  guint16 sequence = 1;
  GstBuffer *old = good.packet (7, sequence), *again = gst_buffer_copy_deep (old);
  fail_unless (decrypter.opens (old));
  for (guint32 i = 0; decrypter.streams () > i; i++) {
    ck_assert_int_gt (decrypter.opens_after (good, 1000 + i), 0);
    if (i % 10 == 0)
      fail_unless (decrypter.opens (good.packet (7, ++sequence)));
  }
  fail_if (decrypter.opens (again));
  fail_unless (decrypter.opens (good.packet (7, ++sequence)));
}
GST_END_TEST;

static Suite *
srtpgate_suite ()
{
  Suite *suite = suite_create ("srtpgate");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 200);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_who_has_the_key_passes_from_the_first_packet_on);
  tcase_add_test (tc, test_a_flood_of_ssrcs_makes_no_streams_and_keeps_nobody_out);
  tcase_add_test (tc, test_bytes_that_are_no_packets_do_not_pass);
  tcase_add_test (tc, test_the_streams_of_genuine_senders_are_bounded_and_those_who_send_go_on);
  tcase_add_test (
      tc, test_a_receiver_that_comes_after_the_sequence_numbers_started_over_opens_the_stream);
  tcase_add_test (tc, test_a_flood_of_strangers_does_not_keep_out_a_sender_of_unknown_roll_over);
  tcase_add_test (tc, test_a_wrong_key_opens_with_no_roll_over);
  tcase_add_test (tc, test_sequence_numbers_may_start_over_while_the_roll_over_is_looked_for);
  tcase_add_test (tc, test_a_known_sender_is_found_again_after_a_long_loss_and_replays_are_not);
  tcase_add_test (tc, test_a_sender_that_begins_again_with_the_same_ssrc_is_found);
  tcase_add_test (tc, test_replays_stay_out_when_senders_were_forgotten);
  return suite;
}

GST_CHECK_MAIN (srtpgate);
