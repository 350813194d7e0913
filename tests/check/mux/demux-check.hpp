/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A rangedemux in harnesses, and frame sets for it. */
#pragma once

#include <map> /* before GStreamer's check header, whose macros hide names of it */

#include "../coded-check.hpp"

namespace rangecast::testing {

inline constexpr GstClockTime kFrame = GST_SECOND / 30;

inline Rig
views_of (const Rig &rig, std::initializer_list<int> ids)
{
  Rig some;
  for (int id : ids)
    some.views.push_back (rig.views[id]);
  return some;
}

using Units = std::vector<std::vector<guint8>>;

/* A rangedemux whose pads are all linked, each to a harness. */
struct Demux {
  GstHarness *in;
  std::map<std::string, GstHarness *> out;
  std::string told; /* what pads were added (+), removed (-), and no-more-pads (.), in order */
  bool link = true;

  explicit Demux (bool linked = true) : in (harness_of_sink ()), link (linked)
  {
    g_signal_connect (in->element, "pad-added", G_CALLBACK (added), this);
    g_signal_connect (in->element, "pad-removed", G_CALLBACK (removed), this);
    g_signal_connect (in->element, "no-more-pads", G_CALLBACK (no_more), this);
    gst_harness_play (in);
  }
  ~Demux ()
  {
    gst_element_set_state (in->element, GST_STATE_NULL);
    for (auto &[name, h] : out)
      gst_harness_teardown (h);
    gst_harness_teardown (in);
  }
  Demux (const Demux &) = delete;
  Demux &operator= (const Demux &) = delete;

  GstHarness *operator[] (int view)
  {
    const auto it = out.find ("src_" + std::to_string (view));
    fail_unless (it != out.end (), "no pad for view %d", view);
    return it->second;
  }
  GstBuffer *pull (int view)
  {
    GstBuffer *buffer = gst_harness_try_pull ((*this)[view]);
    fail_unless (buffer != nullptr, "nothing of view %d", view);
    return buffer;
  }
  GstFlowReturn push (GstBuffer *buffer) { return gst_harness_push (in, buffer); }
  void set_caps (GstCaps *caps) { gst_harness_set_src_caps (in, caps); }
  guint64 stat (const char *field)
  {
    GstStructure *stats;
    guint64 value = G_MAXUINT64;
    g_object_get (in->element, "stats", &stats, nullptr);
    gst_structure_get_uint64 (stats, field, &value);
    gst_structure_free (stats);
    return value;
  }

private:
  static GstHarness *harness_of_sink ()
  {
    GstElement *element = gst_element_factory_make ("rangedemux", nullptr);
    GstHarness *h = gst_harness_new_with_element (element, "sink", nullptr);
    gst_object_unref (element);
    return h;
  }
  static void added (GstElement *element, GstPad *pad, Demux *self)
  {
    self->told += std::string ("+") + GST_PAD_NAME (pad);
    if (!self->link)
      return;
    GstHarness *h = gst_harness_new_with_element (element, nullptr, nullptr);
    gst_harness_add_element_src_pad (h, pad);
    GstHarness *&place = self->out[GST_PAD_NAME (pad)];
    if (place)
      gst_harness_teardown (place);
    place = h;
  }
  static void removed (GstElement *, GstPad *pad, Demux *self)
  {
    if (GST_PAD_IS_SRC (pad))
      self->told += std::string ("-") + GST_PAD_NAME (pad);
  }
  static void no_more (GstElement *, Demux *self) { self->told += "."; }
};

inline Rig
rig_of_pad (GstHarness *h, const char *media_type)
{
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  fail_unless (caps != nullptr);
  fail_unless_equals_string (gst_structure_get_name (gst_caps_get_structure (caps, 0)), media_type);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  fail_unless_equals_int (info.fps_n, 30);
  gst_caps_unref (caps);
  return info.rig;
}

/* Slices of some views, whole units each, made up: only headers matter here. */
inline std::vector<guint8>
slice_unit (int view, bool key, GstClockTime time, guint8 mark, int rows = 1, int first_row = 0)
{
  std::vector<guint8> unit (kSliceHeaderSize + !key + 1, mark);
  SliceHeader h;
  h.key = key;
  h.view_id = guint8 (view);
  h.depth_bits = 12;
  h.colour_bits = 6;
  h.capture_time_ns = time;
  h.roi = {0, 0, 2, 4};
  h.first_row = first_row;
  h.rows = rows;
  h.columns = 2;
  h.reference_distance = !key;
  write_slice_header (h, unit.size (), unit.data ());
  return unit;
}

} // namespace rangecast::testing
