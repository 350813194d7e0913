/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Who is taken for a sender among many strangers, and who is a rival of one. */
#include "rtp/senderprobation.hpp"

#include <memory>
#include <string>

#include "../rangecast-check.hpp"
#include "rtp/senderrivals.hpp"

struct Unref {
  void operator() (gpointer object) const { g_object_unref (object); }
};

/* Somebody who sends one sound packet after another. */
struct Stranger {
  std::unique_ptr<GSocketAddress, Unref> address;
  SenderProbation::Packet packet;

  Stranger (const std::string &host, guint16 port, guint32 ssrc)
      : address (g_inet_socket_address_new_from_string (host.c_str (), port)), packet{
                                                                                   address.get (),
                                                                                   ssrc, 100, 1, 0}
  {
  }
};

struct Probation {
  SenderProbation probation;
  GstClockTime time = 0;
  guint32 strangers = 0;
  int passed = 0; /* packets that came out */

  bool send (Stranger &stranger)
  {
    time += 100 * GST_USECOND;
    stranger.packet.sequence++;
    stranger.packet.time = time;
    GstBuffer *buffer = gst_buffer_new ();
    SenderProbation::Stream stream;
    const bool is_sender = probation.add (stranger.packet, buffer, stream);
    passed += int (stream.size ());
    stream.unref ();
    gst_buffer_unref (buffer);
    return is_sender;
  }
  /* So many strangers who send one packet each, from one host or from a host of his own each. */
  void flood (int packets, const char *host)
  {
    for (int i = 0; i < packets; i++) {
      const guint32 n = strangers++;
      Stranger stranger (host ? host
                              : "10." + std::to_string (n / 65536) + "." +
                                    std::to_string (n / 256 % 256) + "." + std::to_string (n % 256),
          guint16 (1024 + n % 60000), 1000 + n);
      fail_if (send (stranger));
    }
  }
};

GST_START_TEST (test_a_flood_of_strangers_from_one_host_does_not_keep_a_sender_out)
{
  Probation p;
  Stranger good ("192.168.0.1", 5000, 1);
  for (int i = 0; i < 4; i++) {
    p.flood (700, "192.168.0.9");
    fail_unless_equals_int (p.send (good), i == 3);
  }
  fail_unless_equals_int (p.passed, 4); /* none of it was forgotten */
}
GST_END_TEST;

GST_START_TEST (test_a_flood_from_everywhere_does_not_drive_out_one_of_two_packets)
{
  Probation p;
  Stranger good ("192.168.0.1", 5000, 1);
  fail_if (p.send (good));
  p.flood (60, nullptr);
  for (int i = 1; i < 4; i++) {
    fail_unless_equals_int (p.send (good), i == 3);
    p.flood (700, nullptr);
  }
  fail_unless_equals_int (p.passed, 4);
}
GST_END_TEST;

GST_START_TEST (test_a_flood_from_the_senders_own_host_does_not_drive_out_one_of_two_packets)
{
  Probation p;
  Stranger good ("192.168.0.1", 5000, 1);
  fail_if (p.send (good));
  p.flood (15, "192.168.0.1");
  for (int i = 1; i < 4; i++) {
    fail_unless_equals_int (p.send (good), i == 3);
    p.flood (700, "192.168.0.1");
  }
  fail_unless_equals_int (p.passed, 4);
}
GST_END_TEST;

/* Else 64 strangers of two packets each would keep everybody out forever. */
GST_START_TEST (test_strangers_who_fell_silent_make_room)
{
  Probation p;
  for (guint32 i = 0; i < SenderProbation::kCandidates; i++) {
    Stranger half ("10.0.0." + std::to_string (i + 1), 5000, i);
    for (int k = 0; k < 3; k++)
      fail_if (p.send (half));
  }
  p.time += SenderProbation::kStale;
  Stranger good ("192.168.0.1", 5000, 1);
  for (int i = 0; i < 4; i++) {
    p.flood (10, nullptr);
    fail_unless_equals_int (p.send (good), i == 3);
  }
}
GST_END_TEST;

/* ---- rivals ---- */

static bool
rival (SenderRivals &rivals, Stranger &who, GstClockTime time, GstClockTime sender_time)
{
  who.packet.time = time;
  return rivals.add (who.packet, sender_time);
}

GST_START_TEST (test_a_rival_of_few_packets_is_told_after_two_seconds_beside_the_sender)
{
  SenderRivals rivals;
  Stranger other ("192.168.0.2", 5000, 2);
  int told = 0;
  for (GstClockTime time = 0; time <= 10 * GST_SECOND; time += GST_SECOND / 2) {
    told += rival (rivals, other, time, time);
    fail_unless_equals_int (told, time >= 2 * GST_SECOND);
  }
  rivals.clear ();
  for (int i = 0; i < 3; i++)
    fail_if (rival (rivals, other, i * GST_SECOND, i * GST_SECOND));
}
GST_END_TEST;

GST_START_TEST (test_who_comes_because_the_sender_is_gone_is_no_rival)
{
  SenderRivals rivals;
  Stranger other ("192.168.0.2", 5000, 2);
  for (int i = 0; i < 50; i++)
    fail_if (rival (rivals, other, i * GST_SECOND, GST_SECOND));
}
GST_END_TEST;

GST_START_TEST (test_a_hundred_packets_of_anybody_are_rivals_at_once)
{
  SenderRivals rivals;
  for (guint32 i = 0; i < 99; i++) {
    Stranger other ("192.168.0.2", 5000, 2 + i);
    fail_if (rival (rivals, other, i, i));
  }
  Stranger other ("192.168.0.2", 5000, 2);
  fail_unless (rival (rivals, other, 100, 100));
  fail_if (rival (rivals, other, 101, 101));
}
GST_END_TEST;

/* One from a stranger each quarter of an hour, and one from each of many strangers. */
GST_START_TEST (test_stray_packets_over_weeks_are_no_rivals)
{
  SenderRivals rivals;
  Stranger other ("192.168.0.2", 5000, 2);
  for (guint64 i = 0; i < 2000; i++) {
    Stranger stray ("192.168.0.3", 5000, 100 + guint32 (i));
    const GstClockTime time = i * 900 * GST_SECOND;
    fail_if (rival (rivals, other, time, time));
    fail_if (rival (rivals, stray, time + 300 * GST_SECOND, time + 300 * GST_SECOND));
  }
  int told = 0; /* and it sees those that are */
  for (guint32 i = 0; i < 1000; i++)
    told += rival (rivals, other, i * GST_MSECOND, i * GST_MSECOND);
  fail_unless_equals_int (told, 1);
}
GST_END_TEST;

static Suite *
senderprobation_suite ()
{
  Suite *suite = suite_create ("senderprobation");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_a_flood_of_strangers_from_one_host_does_not_keep_a_sender_out);
  tcase_add_test (tc, test_a_flood_from_everywhere_does_not_drive_out_one_of_two_packets);
  tcase_add_test (tc, test_a_flood_from_the_senders_own_host_does_not_drive_out_one_of_two_packets);
  tcase_add_test (tc, test_strangers_who_fell_silent_make_room);
  tcase_add_test (tc, test_a_rival_of_few_packets_is_told_after_two_seconds_beside_the_sender);
  tcase_add_test (tc, test_who_comes_because_the_sender_is_gone_is_no_rival);
  tcase_add_test (tc, test_a_hundred_packets_of_anybody_are_rivals_at_once);
  tcase_add_test (tc, test_stray_packets_over_weeks_are_no_rivals);
  return suite;
}

GST_CHECK_MAIN (senderprobation);
