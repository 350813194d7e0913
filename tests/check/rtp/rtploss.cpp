/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Coded frame sets over RTP through losses that the test chooses, of which every pixel is known. */
#include "../scene-check.hpp"

#include <gst/rtp/gstrtpbuffer.h>

#include <random>

using namespace rangecast;
using namespace rangecast::testing;

static const char *const kProfiles[] = {"packed", "entropy"};

/* A moving scene in packets, those of each frame set together. */
struct Packets {
  Scene scene;
  GstCaps *caps;
  std::vector<std::vector<GstBuffer *>> frame_sets;

  Packets (const std::string &encoder, int count, int views = 4)
      : scene (views, kWidth, kHeight, count)
  {
    GstHarness *h =
        gst_harness_new_parse (("neighbourcodeenc " + encoder + " ! rtpneighbourcodepay").c_str ());
    gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
    for (GstBuffer *frame_set : scene.frame_sets) {
      fail_unless_equals_int (gst_harness_push (h, gst_buffer_ref (frame_set)), GST_FLOW_OK);
      frame_sets.push_back (pull_all (h));
    }
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
  }
  ~Packets ()
  {
    for (auto &packets : frame_sets)
      unref_all (packets);
    gst_caps_unref (caps);
  }
  Packets (const Packets &) = delete;
  Packets &operator= (const Packets &) = delete;

  static constexpr int kWidth = 320, kHeight = 240;
};

/* Of each frame set, whether packets are lost. */
using Losses = std::vector<std::vector<bool>>;

static Losses
no_losses (const Packets &packets)
{
  Losses losses;
  for (const auto &frame_set : packets.frame_sets)
    losses.emplace_back (frame_set.size (), false);
  return losses;
}

/* What a decoder makes of the packets that are not lost, frame set by frame set. */
static std::vector<Pixels>
receive (const Packets &packets, const Losses &losses)
{
  GstHarness *h =
      gst_harness_new_parse ("rtpneighbourcodedepay ! neighbourcodedec request-key-units=false");
  gst_harness_set_src_caps (h, gst_caps_ref (packets.caps));
  for (std::size_t i = 0; i < losses.size (); i++)
    for (std::size_t j = 0; j < losses[i].size (); j++)
      if (!losses[i][j])
        fail_unless_equals_int (
            gst_harness_push (h, gst_buffer_ref (packets.frame_sets[i][j])), GST_FLOW_OK);
  gst_harness_push_event (h, gst_event_new_eos ());
  std::vector<Pixels> received (losses.size ());
  while (GstBuffer *buffer = gst_harness_try_pull (h)) {
    const GstClockTime time = gst_range_buffer_get_capture_time (buffer);
    const auto i = std::size_t ((time + Scene::kInterval / 2) / Scene::kInterval);
    ck_assert_uint_lt (i, received.size ());
    fail_unless (received[i].empty ());
    received[i] = pixels_of (buffer, Packets::kWidth, Packets::kHeight);
    gst_buffer_unref (buffer);
  }
  gst_harness_teardown (h);
  return received;
}

/* The packet that gives each valid pixel of a frame set (intra profiles); by view-id. */
using Owners = std::map<int, std::vector<int>>;

/* From what each packet gives alone: for it ends a frame set if it has the marker. */
static std::vector<Owners>
owners_of (const Packets &packets)
{
  GstHarness *h = gst_harness_new_parse ("rtpneighbourcodedepay ! neighbourcodedec");
  gst_harness_set_src_caps (h, gst_caps_ref (packets.caps));
  std::vector<Owners> all;
  int twice = 0;
  for (const auto &frame_set : packets.frame_sets) {
    Owners &owners = all.emplace_back ();
    for (std::size_t j = 0; j < frame_set.size (); j++) {
      GstBuffer *packet = gst_buffer_copy_deep (frame_set[j]);
      GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
      fail_unless (gst_rtp_buffer_map (packet, GST_MAP_READWRITE, &rtp));
      gst_rtp_buffer_set_marker (&rtp, TRUE);
      gst_rtp_buffer_unmap (&rtp);
      fail_unless_equals_int (gst_harness_push (h, packet), GST_FLOW_OK);
      GstBuffer *part = gst_harness_try_pull (h);
      if (!part)
        continue; /* nothing but views of the rig */
      for (const auto &[id, plane] : pixels_of (part, Packets::kWidth, Packets::kHeight)) {
        owners[id].resize (plane.size (), -1);
        for (std::size_t i = 0; i < plane.size (); i++)
          if (plane[i]) {
            twice += owners[id][i] >= 0;
            owners[id][i] = int (j);
          }
      }
      gst_buffer_unref (part);
    }
  }
  gst_harness_teardown (h);
  fail_unless_equals_int (twice, 0);
  return all;
}

/* A frame set of which some packets are lost: the pixels of the others, nothing else. */
static Pixels
without_lost (const Pixels &whole, const Owners &owners, const std::vector<bool> &lost)
{
  Pixels left = whole;
  for (auto &[id, plane] : left)
    for (std::size_t i = 0; i < plane.size (); i++)
      if (plane[i] && lost[std::size_t (owners.at (id)[i])])
        plane[i] = 0;
  return left;
}

static void
lose_at_random (Losses &losses, unsigned seed)
{
  std::mt19937 random (seed);
  for (auto &frame_set : losses)
    for (std::size_t j = 0; j < frame_set.size (); j++)
      frame_set[j] = random () % 20 == 0;
}

GST_START_TEST (test_at_5_percent_loss_exactly_the_pixels_of_packets_that_came_are_there_and_right)
{
  for (const char *profile : kProfiles) {
    const Packets packets (std::string ("profile=") + profile, 6);
    const auto whole = receive (packets, no_losses (packets));
    const auto owners = owners_of (packets);
    int lossy_sets = 0;
    for (const unsigned seed : {1, 2}) {
      Losses losses = no_losses (packets);
      lose_at_random (losses, seed);
      const auto lossy = receive (packets, losses);
      for (std::size_t i = 0; i < whole.size (); i++) {
        /* Of each frame set, so that damage is gone with the next one. */
        const Compared c = compare (without_lost (whole[i], owners[i], losses[i]), lossy[i]);
        fail_unless (
            c.right == c.valid && c.wrong == 0, "%s, seed %u, frame set %zu", profile, seed, i);
        lossy_sets += compare (whole[i], lossy[i]).right_share () < 1;
      }
    }
    ck_assert_int_gt (lossy_sets, 4);
  }
}
GST_END_TEST;

static Suite *
rtploss_suite ()
{
  Suite *suite = suite_create ("rtploss");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (
      tc, test_at_5_percent_loss_exactly_the_pixels_of_packets_that_came_are_there_and_right);
  return suite;
}

GST_CHECK_MAIN (rtploss);
