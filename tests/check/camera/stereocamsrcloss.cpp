/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc over a network that loses packets: no image gets a wrong partner. */
#include "stereocam-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* A picture of 64x48 is three packets, and a leader and a trailer. */
static void
expect_exact_pairs (const char *properties, int cameras, double loss, int pairs, int fps)
{
  TestCameras rig (cameras, loss);
  const std::string caps = "video/x-raw,format=GRAY8,framerate=" + std::to_string (fps) + "/1";
  CameraPipeline p (std::string (properties) +
                        " packet-resend=false packet-size=1500 buffers=24 "
                        "num-buffers=" +
                        std::to_string (pairs),
      cameras, caps.c_str ());
  p.play_to_the_end ();
  fail_unless_equals_uint64 (p.seen (0).size () + p.stat ("overrun-left"), guint64 (pairs));
  /* half a period by the stamps, whose reading is not exact on a busy machine; a shift is a whole
   */
  expect_pairs (p, cameras, GST_SECOND / fps * 6 / 10);
  guint64 dropped = 0, incomplete = 0;
  for (int side = 0; side < cameras; side++) {
    dropped += p.stat ((std::string ("dropped-") + kSides[side]).c_str ());
    incomplete += p.stat ((std::string ("incomplete-") + kSides[side]).c_str ());
  }
  g_print ("%s, %.0f %% loss, %d cameras: %d sets, %" G_GUINT64_FORMAT
           " pictures without partner (%d time mismatches, %d unknown), %" G_GUINT64_FORMAT
           " incomplete, %d ticks missed\n",
      properties, loss * 100, cameras, pairs, dropped, int (p.stat ("time-mismatch")),
      int (p.stat ("unknown")), incomplete, int (p.stat ("missed-ticks")));
  fail_unless (incomplete > 0, "nothing was lost");
  fail_unless (dropped > 0, "no partner was dropped");
}

/* The fake cameras begin to count at 65000: their numbers go from 65535 to 1 within these. */
GST_START_TEST (test_software_pairs_are_exact_at_5_percent_loss)
{
  expect_exact_pairs ("trigger=software", 2, 0.05, 700, 100);
}
GST_END_TEST;

GST_START_TEST (test_free_running_pairs_are_exact_at_5_percent_loss)
{
  expect_exact_pairs ("trigger=free-run", 2, 0.05, 300, 50);
}
GST_END_TEST;

GST_START_TEST (test_sets_of_three_are_exact_at_5_percent_loss)
{
  expect_exact_pairs ("trigger=software", 3, 0.05, 150, 50);
}
GST_END_TEST;

GST_START_TEST (test_lost_packets_are_sent_again)
{
  TestCameras rig (2, 0.05, true);
  CameraPipeline p ("trigger=software packet-size=1500 buffers=24 num-buffers=100");
  p.play_to_the_end ();
  ck_assert_uint_gt (p.stat ("resent-packets"), 0);
  /* without, 9 of 10 sets lose one of ten packets or more */
  ck_assert_uint_lt (p.stat ("incomplete-left") + p.stat ("incomplete-right"), 40);
}
GST_END_TEST;

static Suite *
stereocamsrcloss_suite ()
{
  Suite *suite = suite_create ("stereocamsrcloss");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_software_pairs_are_exact_at_5_percent_loss);
  tcase_add_test (tc, test_free_running_pairs_are_exact_at_5_percent_loss);
  tcase_add_test (tc, test_sets_of_three_are_exact_at_5_percent_loss);
  tcase_add_test (tc, test_lost_packets_are_sent_again);
  return suite;
}

GST_CHECK_MAIN (stereocamsrcloss);
