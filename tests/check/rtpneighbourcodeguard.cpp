/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "coded-check.hpp"

#include <gst/net/gstnetaddressmeta.h>
#include <gst/rtp/rtp.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr const char *kCaps = "application/x-rtp,media=application,clock-rate=90000,"
                                     "encoding-name=X-NEIGHBOUR-CODE,payload=96";
static constexpr guint kOurs = 0x1111, kOthers = 0x2222;

/* Packets of a sender. */
class Sender {
public:
  explicit Sender (guint ssrc, guint8 payload_type = 96)
      : ssrc_ (ssrc), payload_type_ (payload_type)
  {
    const Rig rig = ring_rig (1, 64, 48);
    payload_ = encoded_units (rig, make_frame_set (rig, 0)).front ();
  }
  GstBuffer *packet (GstClockTime time) { return packet (payload_, time); }
  GstBuffer *packet (const std::vector<guint8> &payload, GstClockTime time)
  {
    GstBuffer *buffer = gst_rtp_buffer_new_allocate (guint (payload.size ()), 0, 0);
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    gst_rtp_buffer_map (buffer, GST_MAP_WRITE, &rtp);
    gst_rtp_buffer_set_ssrc (&rtp, ssrc_);
    gst_rtp_buffer_set_payload_type (&rtp, payload_type_);
    gst_rtp_buffer_set_seq (&rtp, sequence_++);
    memcpy (gst_rtp_buffer_get_payload (&rtp), payload.data (), payload.size ());
    gst_rtp_buffer_unmap (&rtp);
    GST_BUFFER_PTS (buffer) = time;
    return buffer;
  }
  [[nodiscard]] const std::vector<guint8> &payload () const { return payload_; }

private:
  guint ssrc_;
  guint8 payload_type_;
  guint16 sequence_ = 0;
  std::vector<guint8> payload_;
};

static GstHarness *
guard ()
{
  GstHarness *h = gst_harness_new ("rtpneighbourcodeguard");
  gst_harness_set_src_caps_str (h, kCaps);
  return h;
}

/* Whether a packet comes out. */
static bool
passes (GstHarness *h, GstBuffer *packet)
{
  fail_unless_equals_int (gst_harness_push (h, packet), GST_FLOW_OK);
  GstBuffer *out = gst_harness_try_pull (h);
  if (out)
    gst_buffer_unref (out);
  return out != nullptr;
}

static guint64
stat (GstHarness *h, const char *field)
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  g_object_get (h->element, "stats", &stats, nullptr);
  fail_unless (gst_structure_get_uint64 (stats, field, &value));
  gst_structure_free (stats);
  return value;
}

GST_START_TEST (test_bytes_that_are_no_units_do_not_pass)
{
  GstHarness *h = guard ();
  Sender sender (kOurs);
  fail_if (passes (h, gst_buffer_new_memdup ("hello", 5)));
  fail_if (passes (h, sender.packet (std::vector<guint8> (100, 0x80), 0)));
  fail_if (passes (h, sender.packet (std::vector<guint8> (), 0)));
  auto longer = sender.payload (), shorter = longer;
  longer.push_back (0);
  shorter.pop_back ();
  fail_if (passes (h, sender.packet (longer, 0)));
  fail_if (passes (h, sender.packet (shorter, 0)));
  fail_unless_equals_uint64 (stat (h, "foreign"), 5);
  fail_unless (passes (h, sender.packet (0)));
  fail_unless_equals_uint64 (stat (h, "passed"), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_second_sender_is_dropped_while_the_first_one_sends)
{
  GstHarness *h = guard ();
  Sender ours (kOurs), others (kOthers);
  for (GstClockTime time = 0; time < 3 * GST_SECOND; time += 100 * GST_MSECOND) {
    fail_unless (passes (h, ours.packet (time)));
    fail_if (passes (h, others.packet (time)));
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_sender_that_comes_back_with_another_ssrc_takes_over_after_the_timeout)
{
  GstHarness *h = guard ();
  Sender before (kOurs), after (kOthers);
  fail_unless (passes (h, before.packet (0)));
  fail_if (passes (h, after.packet (499 * GST_MSECOND)));
  fail_unless_equals_int (gst_harness_push (h, after.packet (500 * GST_MSECOND)), GST_FLOW_OK);
  GstBuffer *first = gst_harness_pull (h);
  fail_unless (GST_BUFFER_FLAG_IS_SET (first, GST_BUFFER_FLAG_DISCONT));
  gst_buffer_unref (first);
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  guint ssrc = 0;
  fail_unless (gst_structure_get_uint (gst_caps_get_structure (caps, 0), "ssrc", &ssrc));
  fail_unless_equals_int (ssrc, kOthers);
  fail_if (gst_structure_has_field (gst_caps_get_structure (caps, 0), "payload"));
  gst_caps_unref (caps);
  fail_if (passes (h, before.packet (501 * GST_MSECOND)));
  fail_unless_equals_uint64 (stat (h, "senders"), 2);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_copies_of_the_senders_packets_from_another_address_are_dropped)
{
  GstHarness *h = guard ();
  Sender ours (kOurs);
  GSocketAddress *here = g_inet_socket_address_new_from_string ("10.0.0.2", 5000),
                 *there = g_inet_socket_address_new_from_string ("10.0.0.2", 5001);
  GstBuffer *packets[] = {ours.packet (0), ours.packet (0), ours.packet (0)};
  gst_buffer_add_net_address_meta (packets[0], here);
  gst_buffer_add_net_address_meta (packets[1], there);
  gst_buffer_add_net_address_meta (packets[2], here);
  fail_unless (passes (h, packets[0]));
  fail_if (passes (h, packets[1]));
  fail_unless (passes (h, packets[2]));
  gst_harness_teardown (h);
  g_object_unref (here);
  g_object_unref (there);
}
GST_END_TEST;

GST_START_TEST (test_fec_and_retransmissions_of_the_sender_pass)
{
  GstHarness *h = guard ();
  Sender media (kOurs), fec (kOurs, 122), again (kOthers, 97), foreign_fec (0x3333, 122);
  const std::vector<guint8> parity (200, 0x55);
  std::vector<guint8> original (
      2 + media.payload ().size ()); /* a sequence number goes before it */
  std::copy (media.payload ().begin (), media.payload ().end (), original.begin () + 2);
  fail_if (passes (h, again.packet (original, 0)));
  fail_unless (passes (h, media.packet (0)));
  fail_unless (passes (h, fec.packet (parity, 0)));
  fail_if (passes (h, foreign_fec.packet (parity, 0)));
  fail_unless (passes (h, again.packet (original, 0)));
  fail_unless (passes (h, again.packet (parity, 0))); /* a FEC packet again */
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_key_unit_requests_name_this_stream_and_not_one_further_down)
{
  GstHarness *h = guard ();
  Sender sender (kOurs);
  fail_unless (passes (h, sender.packet (0)));
  gst_harness_push_upstream_event (
      h, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM,
             gst_structure_new ("GstForceKeyUnit", "ssrc", G_TYPE_UINT, kOthers, nullptr)));
  bool named = false;
  while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
    const GstStructure *structure = gst_event_get_structure (event);
    guint ssrc = 0, payload = 0;
    if (GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM)
      named = gst_structure_get_uint (structure, "ssrc", &ssrc) && ssrc == kOurs &&
              gst_structure_get_uint (structure, "payload", &payload) && payload == 96;
    gst_event_unref (event);
  }
  fail_unless (named);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_two_senders_that_go_on_are_told_once)
{
  GstHarness *h = guard ();
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  Sender ours (kOurs), others (kOthers);
  fail_unless (passes (h, ours.packet (0)));
  for (int i = 0; i < 300; i++)
    fail_if (passes (h, others.packet (0)));
  int warnings = 0;
  while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_WARNING)) {
    warnings++;
    gst_message_unref (message);
  }
  fail_unless_equals_int (warnings, 1);
  gst_harness_teardown (h);
  gst_object_unref (bus);
}
GST_END_TEST;

GST_START_TEST (test_forgets_the_sender_in_ready_and_with_a_flush)
{
  GstHarness *h = guard ();
  Sender ours (kOurs), others (kOthers);
  fail_unless (passes (h, ours.packet (GST_SECOND)));
  flush (h);
  fail_unless (passes (h, others.packet (0)));
  gst_harness_teardown (h);
  GstElement *element = gst_element_factory_make ("rtpneighbourcodeguard", nullptr);
  for (int i = 0; i < 2; i++) {
    fail_unless_equals_int (
        gst_element_set_state (element, GST_STATE_PLAYING), GST_STATE_CHANGE_SUCCESS);
    fail_unless_equals_int (
        gst_element_set_state (element, GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
  gst_object_unref (element);
}
GST_END_TEST;

static Suite *
rtpneighbourcodeguard_suite ()
{
  Suite *suite = suite_create ("rtpneighbourcodeguard");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_bytes_that_are_no_units_do_not_pass);
  tcase_add_test (tc, test_a_second_sender_is_dropped_while_the_first_one_sends);
  tcase_add_test (tc, test_a_sender_that_comes_back_with_another_ssrc_takes_over_after_the_timeout);
  tcase_add_test (tc, test_copies_of_the_senders_packets_from_another_address_are_dropped);
  tcase_add_test (tc, test_fec_and_retransmissions_of_the_sender_pass);
  tcase_add_test (tc, test_key_unit_requests_name_this_stream_and_not_one_further_down);
  tcase_add_test (tc, test_two_senders_that_go_on_are_told_once);
  tcase_add_test (tc, test_forgets_the_sender_in_ready_and_with_a_flush);
  return suite;
}

GST_CHECK_MAIN (rtpneighbourcodeguard);
