/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../coded-check.hpp"

#include <gst/rtp/rtp.h>

using namespace rangecast;
using namespace rangecast::testing;

static GstHarness *
payloader (const Rig &rig, const char *properties = "")
{
  GstHarness *h = harness_of (std::string ("rtpneighbourcodepay ") + properties);
  gst_harness_set_src_caps (h, coded_caps (rig));
  return h;
}

/* A packet, read. */
struct Packet {
  gsize size = 0;
  bool marker = false;
  guint32 timestamp = 0;
  std::vector<std::vector<guint8>> units;

  explicit Packet (GstBuffer *buffer) : size (gst_buffer_get_size (buffer))
  {
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    fail_unless (gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp));
    marker = gst_rtp_buffer_get_marker (&rtp);
    timestamp = gst_rtp_buffer_get_timestamp (&rtp);
    auto from = static_cast<const guint8 *> (gst_rtp_buffer_get_payload (&rtp));
    units = units_of ({from, gst_rtp_buffer_get_payload_len (&rtp)});
    gst_rtp_buffer_unmap (&rtp);
  }
  int count (UnitType type) const
  {
    int n = 0;
    for (const auto &unit : units)
      n += (unit[0] & 15) == int (type);
    return n;
  }
};

static std::vector<Packet>
pull_packets (GstHarness *h)
{
  std::vector<Packet> packets;
  auto buffers = pull_all (h);
  for (GstBuffer *buffer : buffers)
    packets.emplace_back (buffer);
  unref_all (buffers);
  return packets;
}

static int
count (const std::vector<Packet> &packets, UnitType type)
{
  int n = 0;
  for (const Packet &packet : packets)
    n += packet.count (type);
  return n;
}

static GstBuffer *
access_unit (const Rig &rig, GstClockTime time = 0, const char *properties = "")
{
  return buffer_of (encoded_units (rig, make_frame_set (rig, time), properties), time);
}

GST_START_TEST (test_no_packet_is_longer_than_the_mtu)
{
  const Rig rig = ring_rig (2);
  for (const int mtu : {600, 1000, 1400, 9000}) {
    GstHarness *h = payloader (rig, ("mtu=" + std::to_string (mtu)).c_str ());
    const std::string limit = "max-slice-size=" + std::to_string (std::min (mtu - 12, 1200));
    gst_harness_push (h, access_unit (rig, 0, limit.c_str ()));
    gsize longest = 0;
    for (const Packet &packet : pull_packets (h))
      longest = std::max (longest, packet.size);
    ck_assert_uint_le (longest, gsize (mtu));
    ck_assert_uint_gt (longest, gsize (mtu) * 2 / 3);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* Caps of a peer that wants transport-wide sequence numbers and the time of sending. */
static constexpr const char *kWithExtensions =
    "application/x-rtp, "
    "extmap-1=(string)http://www.ietf.org/id/draft-holmer-rmcat-transport-wide-cc-extensions-01, "
    "extmap-3=(string)urn:ietf:params:rtp-hdrext:ntp-64";

GST_START_TEST (test_no_packet_is_longer_than_the_mtu_with_header_extensions)
{
  const Rig rig = ring_rig (2);
  for (const guint mtu : {1240u, 1400u}) {
    GstHarness *h = gst_harness_new ("rtpneighbourcodepay");
    gst_harness_set_sink_caps_str (h, kWithExtensions);
    g_object_set (h->element, "mtu", mtu, nullptr);
    gst_harness_set_src_caps (h, coded_caps (rig));
    gst_harness_push (h, access_unit (rig, 0, "max-slice-size=300"));
    gsize longest = 0;
    auto packets = pull_all (h);
    ck_assert_uint_gt (packets.size (), 3);
    for (GstBuffer *packet : packets) {
      GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
      gpointer data = nullptr;
      guint size = 0;
      fail_unless (gst_rtp_buffer_map (packet, GST_MAP_READ, &rtp));
      fail_unless (gst_rtp_buffer_get_extension_onebyte_header (&rtp, 1, 0, &data, &size));
      fail_unless_equals_int (size, 2);
      gst_rtp_buffer_unmap (&rtp);
      longest = std::max (longest, gst_buffer_get_size (packet));
    }
    unref_all (packets);
    fail_unless (longest <= mtu, "%d bytes, mtu %d", int (longest), int (mtu));
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_every_packet_decodes_alone)
{
  const Rig rig = ring_rig (3);
  GstHarness *h = payloader (rig, "mtu=1400");
  gst_harness_push (h, access_unit (rig));
  AccessUnitDecoder decoder;
  fail_unless_ok (decoder.set_rig (rig));
  DecoderResult all;
  GstBuffer *canvas = make_frame_set (rig);
  {
    gstrange::RangeFrameMap frame (canvas, GST_MAP_READWRITE);
    for (const Packet &packet : pull_packets (h)) {
      std::vector<guint8> bytes;
      for (const auto &unit : packet.units)
        bytes.insert (bytes.end (), unit.begin (), unit.end ());
      decoder.plan (bytes, all);
      std::vector<RangeImage> images;
      for (const auto &view : decoder.views ())
        images.push_back (frame.views ()[std::size_t (view.view_id)]);
      fail_unless_ok (decoder.decode (images, 1, all));
    }
  }
  gst_buffer_unref (canvas);
  fail_unless_equals_uint64 (all.slices, encoded_units (rig, make_frame_set (rig), "").size ());
  fail_unless_equals_uint64 (all.bad_slices, 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_error_for_a_long_slice_names_the_max_slice_size_and_mtu_that_fit)
{
  const Rig rig = ring_rig (1);
  const auto slices = encoded_units (rig, make_frame_set (rig), "max-slice-size=1200");
  gsize first_long = 0;
  for (const auto &slice : slices)
    if (first_long == 0 && slice.size () > 1000 - 12)
      first_long = slice.size ();
  GstHarness *h = payloader (rig, "mtu=1000");
  {
    ErrorCounter errors (h);
    fail_unless_equals_int (gst_harness_push (h, buffer_of (slices)), GST_FLOW_ERROR);
    const std::string text = next_message_text (errors.bus, GST_MESSAGE_ERROR);
    fail_unless_contains (text, "A slice of " + std::to_string (first_long));
    fail_unless_contains (text, "max-slice-size=988");
    fail_unless_contains (text, "mtu=" + std::to_string (first_long + 12));
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_rig_is_sent_at_once)
{
  const Rig one = ring_rig (1, 64, 48), two = ring_rig (2, 128, 96);
  GstHarness *h = payloader (one, "config-interval=3600");
  for (const Rig *rig : {&one, &two, &one}) {
    gst_harness_set_src_caps (h, coded_caps (*rig));
    gst_harness_push (h, access_unit (*rig));
    gst_harness_push (h, access_unit (*rig, 1));
    fail_unless_equals_int (count (pull_packets (h), UnitType::kRigView), int (rig->views.size ()));
    GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
    const gchar *width = gst_structure_get_string (gst_caps_get_structure (caps, 0), "width");
    fail_unless_cmp (std::to_string (rig->views[0].width), ==, width);
    gst_caps_unref (caps);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_without_config_interval_only_a_changed_rig_is_sent_and_once)
{
  const Rig one = ring_rig (1, 64, 48), two = ring_rig (2, 128, 96);
  GstHarness *h = payloader (one, "config-interval=0");
  gst_harness_push (h, access_unit (one));
  fail_unless_equals_int (count (pull_packets (h), UnitType::kRigView), 0);
  gst_harness_set_src_caps (h, coded_caps (two));
  gst_harness_push (h, access_unit (two));
  const auto packets = pull_packets (h);
  fail_unless_equals_int (packets[0].count (UnitType::kRigView), 2);
  for (const GstClockTime time : {GST_SECOND, 10 * GST_SECOND})
    gst_harness_push (h, access_unit (two, time));
  gst_element_set_state (h->element, GST_STATE_NULL); /* another stream */
  gst_harness_play (h);
  gst_harness_set_src_caps (h, coded_caps (one));
  gst_harness_push (h, access_unit (one));
  fail_unless_equals_int (count (pull_packets (h), UnitType::kRigView), 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_units_that_belong_to_files_are_not_sent)
{
  const Rig rig = ring_rig (1);
  const auto units = encoded_units (rig, make_frame_set (rig));
  auto of_file = units;
  for (const std::size_t at : {std::size_t{0}, units.size () / 2, units.size ()}) {
    std::vector<guint8> unit = {kBitstreamVersion << 4 | 3, 0, 4, 0};
    of_file.insert (of_file.begin () + std::ptrdiff_t (at), unit);
  }
  GstHarness *h = payloader (rig, "config-interval=0");
  gst_harness_push (h, buffer_of (of_file));
  std::vector<std::vector<guint8>> sent;
  const auto packets = pull_packets (h);
  for (const Packet &packet : packets)
    sent.insert (sent.end (), packet.units.begin (), packet.units.end ());
  fail_unless (sent == units);
  fail_unless (packets.back ().marker);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_damaged_and_empty_access_units_are_no_error)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = payloader (rig, "config-interval=0");
  gst_harness_push (h, access_unit (rig));
  const int all = count (pull_packets (h), UnitType::kSlice);
  GstBuffer *cut = access_unit (rig);
  gst_buffer_set_size (cut, gssize (gst_buffer_get_size (cut)) - 5);
  fail_unless_equals_int (gst_harness_push (h, cut), GST_FLOW_OK);
  fail_unless_equals_int (count (pull_packets (h), UnitType::kSlice), all - 1);
  fail_unless_equals_int (gst_harness_push (h, gst_buffer_new ()), GST_FLOW_OK);
  fail_unless_equals_int (pull_packets (h).size (), 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_last_packet_of_a_frame_set_has_the_marker)
{
  const Rig rig = ring_rig (2);
  const auto units = encoded_units (rig, make_frame_set (rig), "");
  GstHarness *h = payloader (rig, "config-interval=-1");
  for (int frame = 0; frame < 2; frame++) {
    gst_harness_push (h, buffer_of (units, frame * GST_SECOND / 30));
    const auto packets = pull_packets (h);
    fail_unless_equals_int (count (packets, UnitType::kSlice), int (units.size ()));
    fail_unless_equals_int (count (packets, UnitType::kRigView), 2);
    for (std::size_t i = 0; i < packets.size (); i++) {
      fail_unless_equals_int (packets[i].marker, i + 1 == packets.size ());
      fail_unless_equals_int (packets[i].timestamp, packets[0].timestamp);
    }
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
rtpneighbourcodepay_suite ()
{
  Suite *suite = suite_create ("rtpneighbourcodepay");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_no_packet_is_longer_than_the_mtu);
  tcase_add_test (tc, test_no_packet_is_longer_than_the_mtu_with_header_extensions);
  tcase_add_test (tc, test_every_packet_decodes_alone);
  tcase_add_test (tc, test_error_for_a_long_slice_names_the_max_slice_size_and_mtu_that_fit);
  tcase_add_test (tc, test_new_rig_is_sent_at_once);
  tcase_add_test (tc, test_without_config_interval_only_a_changed_rig_is_sent_and_once);
  tcase_add_test (tc, test_units_that_belong_to_files_are_not_sent);
  tcase_add_test (tc, test_damaged_and_empty_access_units_are_no_error);
  tcase_add_test (tc, test_last_packet_of_a_frame_set_has_the_marker);
  return suite;
}

GST_CHECK_MAIN (rtpneighbourcodepay);
