/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* SRTP as rangecast-run sets it up: whoever joins late decrypts a stream whose sequence numbers
 * have wrapped, and the change of SSRC by which that works costs no frame set. */
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "../rangecast-check.hpp"
#include "run/srtp-key.hpp"

using namespace rangecast::testing;

/* An encrypted packet, whose header is readable. */
struct Packet {
  GstBuffer *buffer;
  guint16 sequence;
  guint32 timestamp, ssrc;
};

struct Packets : std::vector<Packet> {
  ~Packets ()
  {
    for (const Packet &packet : *this)
      gst_buffer_unref (packet.buffer);
  }
  std::set<guint32> ssrcs () const
  {
    std::set<guint32> all;
    for (const Packet &packet : *this)
      all.insert (packet.ssrc);
    return all;
  }
  std::size_t timestamps (std::size_t from) const
  {
    std::set<guint32> all;
    for (; from < size (); from++)
      all.insert (at (from).timestamp);
    return all.size ();
  }
  /* The first packet of a timestamp with the SSRC. */
  std::size_t first_of (guint32 ssrc) const
  {
    for (std::size_t i = 1; i < size (); i++)
      if (at (i).ssrc == ssrc && at (i).timestamp != at (i - 1).timestamp)
        return i;
    return 0;
  }
};

static std::string
key_file (char digit)
{
  const std::string path =
      std::string (g_get_tmp_dir ()) + "/srtp-" + std::to_string (getpid ()) + digit + ".key";
  fail_unless (g_file_set_contents (path.c_str (), std::string (60, digit).c_str (), -1, nullptr));
  return path;
}

static GstElement *
make_pipeline (const std::string &launch, char key)
{
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (launch.c_str (), &error);
  fail_unless (pipeline && !error, "%s", error ? error->message : "");
  const std::string path = key_file (key);
  fail_unless (give_srtp_key (pipeline, path.c_str ()));
  remove (path.c_str ());
  return pipeline;
}

/* @param sender  ends with the element before srtpenc */
static void
encrypt (const std::string &sender, Packets &packets, char key = '1')
{
  GstElement *pipeline = make_pipeline (sender + " ! srtpenc ! appsink name=out sync=false", key);
  GstElement *out = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  while (GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (out))) {
    guint8 header[12];
    GstBuffer *buffer = gst_sample_get_buffer (sample);
    fail_unless_equals_int (gst_buffer_extract (buffer, 0, header, sizeof header), sizeof header);
    packets.push_back ({gst_buffer_ref (buffer), GST_READ_UINT16_BE (header + 2),
        GST_READ_UINT32_BE (header + 4), GST_READ_UINT32_BE (header + 8)});
    gst_sample_unref (sample);
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (out);
  gst_object_unref (pipeline);
}

struct Received {
  int buffers = 0, incomplete = 0; /* DELTA_UNIT: slices are missing */
  guint streams = 0;               /* of srtpdec */
};

/* @param receiver  begins with the element after srtpdec */
static Received
decrypt (const std::string &caps, const std::string &receiver, const Packets &packets,
    std::size_t from = 0, char key = '1')
{
  GstElement *pipeline =
      make_pipeline ("appsrc name=in format=time caps=application/x-srtp," + caps +
                         " ! decrypt.rtp_sink srtpdec name=decrypt "
                         "decrypt.rtp_src ! " +
                         receiver + " ! appsink name=out sync=false",
          key);
  GstElement *in = gst_bin_get_by_name (GST_BIN (pipeline), "in"),
             *out = gst_bin_get_by_name (GST_BIN (pipeline), "out"),
             *decrypter = gst_bin_get_by_name (GST_BIN (pipeline), "decrypt");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (; from < packets.size (); from++) {
    GstBuffer *buffer = gst_buffer_copy_deep (packets[from].buffer); /* decrypted in place */
    GST_BUFFER_DTS (buffer) = GST_BUFFER_PTS (buffer);
    fail_unless_equals_int (gst_app_src_push_buffer (GST_APP_SRC (in), buffer), GST_FLOW_OK);
  }
  gst_app_src_end_of_stream (GST_APP_SRC (in));
  Received received;
  while (GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (out))) {
    received.buffers++;
    received.incomplete +=
        GST_BUFFER_FLAG_IS_SET (gst_sample_get_buffer (sample), GST_BUFFER_FLAG_DELTA_UNIT);
    gst_sample_unref (sample);
  }
  GstStructure *stats = nullptr;
  g_object_get (decrypter, "stats", &stats, nullptr);
  received.streams = gst_value_array_get_size (gst_structure_get_value (stats, "streams"));
  gst_structure_free (stats);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (GstElement *element : {in, out, decrypter, pipeline})
    gst_object_unref (element);
  return received;
}

/* As in pipelines/rangecast/transport.py. */
static const std::string kFrameSets =
    "avatartestsrc num-buffers=40 range-person-only=true views=1 is-live=true ! "
    "video/x-range,width=160,height=120,framerate=30/1 ! neighbourcodeenc max-slice-size=256 ! "
    "rtpneighbourcodepay mtu=300 config-interval=-1 seqnum-offset=";
static const std::string kCaps =
    "media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96";
static const std::string kJitterBuffer =
    "rtpjitterbuffer latency=1000 max-dropout-time=1000 max-misorder-time=500";

static bool
has_elements (std::initializer_list<const char *> names)
{
  for (const char *name : names) {
    GstElementFactory *factory = gst_element_factory_find (name);
    if (!factory)
      return false;
    gst_object_unref (factory);
  }
  return true;
}

static void
check_join (const std::string &sender, const std::string &receiver)
{
  Packets packets;
  encrypt (kFrameSets + "65400" + sender, packets);
  const std::set<guint32> ssrcs = packets.ssrcs ();
  fail_unless_equals_int (int (ssrcs.size ()), 2);
  const guint32 before = packets.front ().ssrc, after = packets.back ().ssrc;
  fail_unless_equals_uint64 (after, guint32 (before + 1));
  const std::size_t late = packets.first_of (after);
  ck_assert_int_gt (late, 0);
  for (std::size_t i = 1; i < packets.size (); i++) /* receivers see no gap */
    fail_unless_equals_int (packets[i].sequence, guint16 (packets[i - 1].sequence + 1));
  ck_assert_uint_lt (packets[late].sequence, 0x1000);
  fail_unless_equals_int (int (packets.timestamps (0)), 40);
  const Received all = decrypt (kCaps, receiver, packets),
                 rest = decrypt (kCaps, receiver, packets, late);
  fail_unless_equals_int (all.buffers, 40);
  fail_unless_equals_int (all.incomplete, 0);
  ck_assert_int_gt (int (packets.timestamps (late)), 5);
  fail_unless_equals_int (rest.buffers, int (packets.timestamps (late)));
  fail_unless_equals_int (rest.incomplete, 0);
}

GST_START_TEST (test_joining_after_the_numbers_wrapped_and_at_the_change_no_frame_set_is_lost)
{
  if (!has_elements ({"srtpenc", "srtpdec"}))
    RANGECAST_SKIP ("no srtpenc");
  check_join ("", "rtpneighbourcodeguard ! " + kJitterBuffer + " ! rtpneighbourcodedepay");
}
GST_END_TEST;

GST_START_TEST (test_the_same_with_retransmission_and_a_session)
{
  if (!has_elements ({"srtpenc", "srtpdec", "rtprtxsend", "rtpsession"}))
    RANGECAST_SKIP ("no srtpenc");
  const std::string map = "payload-type-map=application/x-rtp-pt-map,96=(uint)97,122=(uint)123";
  check_join (" ! rtprtxsend max-size-time=500 " + map +
                  " ! session.send_rtp_sink rtpsession name=session rtp-profile=avpf "
                  "session.send_rtp_src",
      "rtpneighbourcodeguard ! session.recv_rtp_sink rtpsession name=session rtp-profile=avpf "
      "session.recv_rtp_src ! rtprtxreceive " +
          map + " ! rtpneighbourcodeguard ! " + kJitterBuffer + " ! rtpneighbourcodedepay");
}
GST_END_TEST;

GST_START_TEST (test_the_same_with_fec)
{
  if (!has_elements ({"srtpenc", "srtpdec", "rtpulpfecenc"}))
    RANGECAST_SKIP ("no srtpenc");
  check_join (" ! rtpulpfecenc percentage=60 pt=122",
      "rtpneighbourcodeguard ! rtpstorage size-time=500000000 ! " + kJitterBuffer +
          " do-lost=true ! rtpulpfecdec pt=122 ! rtpneighbourcodedepay");
}
GST_END_TEST;

GST_START_TEST (test_speech_changes_its_ssrc_too)
{
  if (!has_elements ({"srtpenc", "srtpdec", "rtpL16pay"}))
    RANGECAST_SKIP ("no srtpenc");
  Packets packets;
  encrypt (
      "audiotestsrc num-buffers=100 samplesperbuffer=480 ! audio/x-raw,rate=48000,channels=1 ! "
      "rtpL16pay min-ptime=10000000 max-ptime=10000000 seqnum-offset=65500",
      packets);
  const std::string caps = "media=audio,clock-rate=48000,encoding-name=L16,channels=1,payload=96",
                    receiver = "rtpneighbourcodeguard ! " + kJitterBuffer;
  fail_unless_equals_int (int (packets.ssrcs ().size ()), 2);
  const std::size_t late = packets.first_of (packets.back ().ssrc);
  fail_unless_equals_int (decrypt (caps, receiver, packets).buffers, int (packets.size ()));
  fail_unless_equals_int (
      decrypt (caps, receiver, packets, late).buffers, int (packets.size () - late));
}
GST_END_TEST;

GST_START_TEST (test_packets_of_another_key_do_not_pass_and_foreign_ssrcs_use_bounded_memory)
{
  if (!has_elements ({"srtpenc", "srtpdec"}))
    RANGECAST_SKIP ("no srtpenc");
  Packets packets;
  encrypt (kFrameSets + "100", packets);
  fail_unless_equals_int (decrypt (kCaps, "rtpneighbourcodeguard", packets, 0, '2').buffers, 0);
  Packets flooded;
  for (std::size_t i = 0; i < packets.size (); i++) {
    flooded.push_back (packets[i]);
    gst_buffer_ref (packets[i].buffer);
    for (guint32 k = 0; k < 10; k++) {
      Packet foreign = packets[i];
      foreign.buffer = gst_buffer_copy_deep (foreign.buffer);
      const guint32 ssrc = GUINT32_TO_BE (1000 + 10 * guint32 (i) + k);
      gst_buffer_fill (foreign.buffer, 8, &ssrc, sizeof ssrc);
      flooded.push_back (foreign);
    }
  }
  const Received received = decrypt (kCaps, "rtpneighbourcodeguard", flooded);
  fail_unless_equals_int (received.buffers, int (packets.size ()));
  ck_assert_uint_le (received.streams, 129);
}
GST_END_TEST;

static Suite *
srtp_suite ()
{
  Suite *suite = suite_create ("srtp");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (
      tc, test_joining_after_the_numbers_wrapped_and_at_the_change_no_frame_set_is_lost);
  tcase_add_test (tc, test_the_same_with_retransmission_and_a_session);
  tcase_add_test (tc, test_the_same_with_fec);
  tcase_add_test (tc, test_speech_changes_its_ssrc_too);
  tcase_add_test (tc, test_packets_of_another_key_do_not_pass_and_foreign_ssrcs_use_bounded_memory);
  return suite;
}

GST_CHECK_MAIN (srtp);
