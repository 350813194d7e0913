/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A rangemux in harnesses. */
#pragma once

#include <vector>

#include "../rangecast-check.hpp"

namespace rangecast::testing {

inline constexpr GstClockTime kFrame = GST_SECOND / 25;

/* A rangemux with N sink pads, one view each. */
struct Mux {
  GstHarness *out;
  std::vector<GstHarness *> in;
  Rig rig;
  GstBus *bus = gst_bus_new ();

  explicit Mux (int views, bool coded = false, bool live = false, const char *properties = "")
      : rig (ring_rig (views, 32, 24))
  {
    GstElement *element =
        gst_parse_launch ((std::string ("rangemux ") + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    out = gst_harness_new_with_element (element, nullptr, "src");
    for (int i = 0; i < views; i++) {
      in.push_back (gst_harness_new_with_element (element, "sink_%u", nullptr));
      gst_harness_set_live (in[i], live);
    }
    gst_object_unref (element);
    if (live)
      gst_harness_use_testclock (out);
    for (int i = 0; i < views; i++) {
      const auto info = gstrange::make_info (one (i), 25, 1);
      gst_harness_set_src_caps (in[i],
          coded ? gstrange::make_neighbour_code_caps (info) : gstrange::make_range_caps (info));
    }
    gst_harness_play (out);
  }
  ~Mux ()
  {
    gst_element_set_bus (out->element, nullptr);
    gst_object_unref (bus);
    for (GstHarness *h : in)
      gst_harness_teardown (h);
    gst_harness_teardown (out);
  }
  Rig one (int view) const
  {
    Rig single;
    single.views = {rig.views[view]};
    return single;
  }
  void push (int view, GstClockTime capture, GstClockTime pts)
  {
    GstBuffer *buffer = make_frame_set (one (view), capture);
    GST_BUFFER_PTS (buffer) = pts;
    fail_unless_equals_int (gst_harness_push (in[view], buffer), GST_FLOW_OK);
  }
  /* Pulls one and gives its views as bits. */
  int pull (GstClockTime *capture = nullptr)
  {
    GstBuffer *buffer = gst_harness_pull (out);
    fail_unless (buffer != nullptr);
    int views = 0;
    gpointer state = nullptr;
    while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
      views |= 1 << meta->view_id;
    if (capture)
      *capture = gst_range_buffer_get_capture_time (buffer);
    {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
      fail_unless_ok (frame.status ());
    }
    gst_buffer_unref (buffer);
    return views;
  }
  guint64 stat (const char *field) { return stats_field (out->element, field); }
};

} // namespace rangecast::testing
