/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One live source feeds all pads of an element through plain queues. While one pad gets nothing the
 * others must not keep the source waiting: output goes on afterwards, with a warning if images were
 * dropped. (A silent third camera: stereodepth.) */
#include "../rangecast-check.hpp"

using namespace rangecast::testing;

static const std::string kCamera =
    "videotestsrc is-live=true ! video/x-raw,format=GRAY8,width=64,height=48,framerate=20/1 ! "
    "tee name=t ";
static const std::string kDepth =
    "stereodepth name=e focal-length=64 baseline=0.1 near=0.45 far=1.3 ! fakesink name=out";
static const std::string kRig =
    "avatartestsrc is-live=true views=2 range-person-only=true loop-frames=1 ! "
    "video/x-range,width=64,height=48,framerate=20/1 ! rangedemux name=t ";
static const std::string kSync = "tee name=t t. ! queue ! s.sink_0 t. ! valve name=v ! queue ! "
                                 "s.sink_1 capturesync name=s s.src_0 ! queue ! ";

static const struct {
  std::string launch; /* with the valve v, and the sink out */
  const char *warning;
} cases[] = {
    {kCamera + "t. ! queue ! e.left t. ! valve name=v ! queue ! e.right " + kDepth,
        "Pad right has no images in time; those of pad left are dropped"},
    {kCamera + "t. ! valve name=v ! queue ! e.left t. ! queue ! e.right " + kDepth,
        "Pad left has no images in time; those of pad right are dropped"},
    {"avatartestsrc is-live=true name=c c.left ! video/x-raw,width=64,height=48,framerate=20/1 ! "
     "queue ! e.left c.right ! valve name=v ! queue ! e.right " +
            kDepth,
        "Pad right has no images in time; those of pad left are dropped"},
    {kCamera + "t. ! queue ! e.colour t. ! valve name=v ! queue ! videoconvert ! "
               "video/x-raw,format=GRAY16_LE ! e.depth rangecombine name=e focal-length=64 ! "
               "fakesink name=out",
        "Pad depth has no images in time; those of pad colour are dropped"},
    {kRig + "t.src_0 ! queue ! e. t.src_1 ! valve name=v ! queue ! e. rangemux name=e ! "
            "fakesink name=out",
        nullptr}, /* the other view goes on alone */
    {kRig + "t.src_0 ! neighbourcodeenc ! queue ! e. t.src_1 ! neighbourcodeenc ! valve name=v ! "
            "queue ! e. rangemux name=e ! fakesink name=out",
        nullptr},
    {kCamera + kSync + "fakesink name=out s.src_1 ! queue ! fakesink",
        "without a capture time are not synchronised"},
    {kCamera + kSync + "fakesink s.src_1 ! queue ! fakesink name=out",
        "without a capture time are not synchronised"},
    {kCamera + "t. ! queue ! e.sink_0 t. ! valve name=v ! queue ! e.sink_1 rigcalibrate name=e "
               "sink_1::view=0 sink_1::role=right ! fakesink name=out",
        nullptr}, /* images of one camera are examined alone */
};

static GstPadProbeReturn
count (GstPad *, GstPadProbeInfo *, gpointer counter)
{
  g_atomic_int_inc (static_cast<gint *> (counter));
  return GST_PAD_PROBE_OK;
}

static void
wait_for_more (gint *counter, int more)
{
  const int wanted = g_atomic_int_get (counter) + more;
  for (int i = 0; i < 6000 && g_atomic_int_get (counter) < wanted; i++)
    g_usleep (10000);
  ck_assert_int_ge (g_atomic_int_get (counter), wanted);
}

GST_START_TEST (test_output_goes_on_after_a_pad_was_silent)
{
  gint counter = 0;
  const auto &[launch, warning] = cases[__i__];
  if (launch.find ("rigcalibrate") != launch.npos &&
      !gst_registry_check_feature_version (gst_registry_get (), "rigcalibrate", 0, 0, 0))
    RANGECAST_SKIP ("built without calibration");
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstElement *valve = gst_bin_get_by_name (GST_BIN (pipeline), "v");
  GstPad *pad = gst_element_get_static_pad (sink, "sink");
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, count, &counter, nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  wait_for_more (&counter, 5);
  g_object_set (valve, "drop", TRUE, nullptr);
  g_usleep (1500000);
  g_object_set (valve, "drop", FALSE, nullptr);
  wait_for_more (&counter, 30);
  if (warning)
    fail_unless_contains (next_message_text (bus, GST_MESSAGE_WARNING), warning);
  fail_unless (next_message_text (bus, GST_MESSAGE_ERROR, 0).empty ());
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (gpointer object :
      {gpointer (pad), gpointer (sink), gpointer (valve), gpointer (bus), gpointer (pipeline)})
    gst_object_unref (object);
}

GST_END_TEST;

static Suite *
stalledinput_suite ()
{
  Suite *s = suite_create ("stalledinput");
  TCase *tc = tcase_create ("stalledinput");
  suite_add_tcase (s, tc);
  tcase_add_loop_test (tc, test_output_goes_on_after_a_pad_was_silent, 0, G_N_ELEMENTS (cases));
  return s;
}

GST_CHECK_MAIN (stalledinput);
