/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Elements that stop while a query comes. GStreamer lets serialised queries through to pads that
 * are flushing, and an ALLOCATION query may bring set_caps() into stop(). ThreadSanitizer sees
 * whether that does harm. */
#include <atomic>
#include <string>
#include <thread>

#include "../scene-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kRounds = 50;

/* An element that is started and stopped, with a sink behind it. */
class Stopper {
public:
  explicit Stopper (const std::string &name)
      : element_ (gst_element_factory_make (name.c_str (), nullptr)),
        end_ (gst_element_factory_make ("fakesink", nullptr))
  {
    fail_unless (element_ && end_);
    gst_object_ref_sink (element_);
    gst_object_ref_sink (end_);
    g_object_set (end_, "async", FALSE, nullptr);
    fail_unless (gst_element_link (element_, end_));
    sink_ = gst_element_get_static_pad (element_, "sink");
    src_ = gst_element_get_static_pad (element_, "src");
  }
  ~Stopper ()
  {
    gst_object_unref (sink_);
    gst_object_unref (src_);
    for (GstElement *element : {element_, end_}) {
      gst_element_set_state (element, GST_STATE_NULL);
      gst_object_unref (element);
    }
  }
  Stopper (const Stopper &) = delete;
  Stopper &operator= (const Stopper &) = delete;

  void play (GstCaps *caps)
  {
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    for (GstElement *element : {end_, element_})
      gst_element_set_state (element, GST_STATE_PLAYING);
    gst_pad_send_event (sink_, gst_event_new_stream_start ("stream"));
    fail_unless (gst_pad_send_event (sink_, gst_event_new_caps (caps)));
    gst_pad_send_event (sink_, gst_event_new_segment (&segment));
  }
  void stop ()
  {
    for (GstElement *element : {element_, end_})
      gst_element_set_state (element, GST_STATE_READY);
  }
  /* Any thread. */
  void query (GstCaps *caps)
  {
    GstQuery *query = gst_query_new_allocation (caps, TRUE);
    gst_pad_mark_reconfigure (src_); /* as somebody downstream asks for */
    gst_pad_query (sink_, query);
    gst_query_unref (query);
  }

private:
  GstElement *element_, *end_;
  GstPad *sink_, *src_;
};

static void
stop_while_queries_come (const std::string &name)
{
  const auto info = gstrange::make_info (ring_rig (2, 32, 24), 30, 1);
  GstCaps *caps = name == "neighbourcodedec"
                      ? gstrange::make_neighbour_code_caps (info, "access-unit")
                      : gstrange::make_range_caps (info);
  Stopper stopper (name);
  std::atomic<bool> quit = false;
  std::thread thread ([&] {
    while (!quit)
      stopper.query (caps);
  });
  for (int i = 0; i < kRounds; i++) {
    stopper.play (caps);
    g_usleep (500);
    stopper.stop ();
  }
  quit = true;
  thread.join ();
  gst_caps_unref (caps);
}

GST_START_TEST (test_query_does_no_harm_to_an_element_that_stops)
{
  for (const char *name : {"cylinderfilter", "neighbourcodedec", "neighbourcodeenc", "plyenc",
           "rangealign", "roiextract"})
    stop_while_queries_come (name);
}
GST_END_TEST;

static Suite *
stopqueries_suite ()
{
  Suite *s = suite_create ("stopqueries");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_query_does_no_harm_to_an_element_that_stops);
  return s;
}
GST_CHECK_MAIN (stopqueries);
