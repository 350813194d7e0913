/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One over each limit of docs/engineering/limits.md that no other test goes over: one error or a
 * drop that is counted, and no more memory. */
#include "../coded-check.hpp"

#include <glib/gstdio.h>
#include <gst/rtp/rtp.h>

#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <rangecast/rigfile/rig_file.hpp>

#include "common/accessunitwriter.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static bool
says (const Status &status, const char *what)
{
  fail_if (status.ok ());
  return status.message ().find (what) != std::string::npos;
}

#if defined(__SANITIZE_ADDRESS__)
static constexpr bool kFreedMemoryStays = true; /* for a while, so that its use is seen */
#else
static constexpr bool kFreedMemoryStays = false;
#endif

/* Bytes of this process that are in memory. */
static gsize
memory_in_use ()
{
  gchar *text = nullptr;
  gulong size = 0, resident = 0;
  fail_unless (g_file_get_contents ("/proc/self/statm", &text, nullptr, nullptr));
  fail_unless_equals_int (sscanf (text, "%lu %lu", &size, &resident), 2);
  g_free (text);
  return resident * gsize (4096);
}

/* ---- rigs ---- */

GST_START_TEST (test_rig_beyond_each_limit_is_refused)
{
  const struct {
    void (*fill) (Rig &), (*exceed) (Rig &);
    const char *error;
  } cases[] = {{[] (Rig &rig) { rig = ring_rig (64, 16, 12); },
                   [] (Rig &rig) { rig.views.push_back (rig.views[0]); }, "64"},
      {[] (Rig &rig) { rig.views[0].id = 63; }, [] (Rig &rig) { rig.views[0].id = 64; },
          "view-id 64"},
      {[] (Rig &rig) { rig = ring_rig (1, kMaxImageSide, 16); },
          [] (Rig &rig) { rig.views[0].width++; }, "16385x16"},
      {[] (Rig &rig) { rig.views[0].name = std::string (kMaxViewName, 'n'); },
          [] (Rig &rig) { rig.views[0].name += 'n'; }, "255"}};
  for (const auto &limit : cases) {
    Rig rig = ring_rig (1);
    limit.fill (rig);
    fail_unless_ok (validate (rig));
    limit.exceed (rig);
    fail_unless (says (validate (rig), limit.error));
  }
  std::vector<guint8> blob = encode_rig (ring_rig (64, 16, 12));
  blob[5] = 65;
  Rig decoded;
  fail_unless (says (decode_rig (blob, decoded), "65 views, at most 64"));
}
GST_END_TEST;

GST_START_TEST (test_rig_of_more_than_2_27_pixels_is_one_error_of_its_caps)
{
  fail_unless_ok (validate (ring_rig (2, 8192, 8192)));
  const Rig rig = ring_rig (3, 8192, 8192);
  fail_unless (says (validate (rig), "134217728"));
  Rig united = ring_rig (2, 8192, 8192), third;
  third.views = {ring_rig (3, 8192, 8192).views[2]};
  fail_unless (says (merge (united, third), "134217728"));
  for (const char *name : {"rangesplit", "rangedemux", "neighbourcodedec"}) {
    GstElement *element = gst_element_factory_make (name, nullptr);
    GstHarness *h = gst_harness_new_with_element (element, "sink", nullptr);
    gst_object_unref (element);
    gst_harness_play (h);
    {
      ErrorCounter errors (h);
      GstCaps *caps = g_str_has_prefix (name, "range") ? range_caps (rig) : coded_caps (rig);
      gst_pad_push_event (h->srcpad, gst_event_new_stream_start ("s"));
      gst_pad_push_event (h->srcpad, gst_event_new_caps (caps));
      GstPad *sink = gst_pad_get_peer (h->srcpad);
      fail_if (gst_pad_has_current_caps (sink), "%s", name);
      gst_object_unref (sink);
      fail_unless_equals_int (errors.take (), 1);
      gst_caps_unref (caps);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_rig_file_beyond_4_MiB_is_refused_unread)
{
  gchar *path = nullptr;
  const int file = g_file_open_tmp ("rig-XXXXXX.yaml", &path, nullptr);
  ck_assert_int_ge (file, 0);
  fail_unless_equals_int (ftruncate (file, off_t (kMaxRigFileSize) + 1), 0);
  Rig rig;
  fail_unless (says (load_rig (path, rig), "4 MiB"));
  fail_unless_equals_int (ftruncate (file, off_t (kMaxRigFileSize)), 0);
  fail_if (says (load_rig (path, rig), "4 MiB"));
  close (file);
  g_unlink (path);
  g_free (path);
}
GST_END_TEST;

GST_START_TEST (test_caps_beyond_the_templates_are_not_accepted)
{
  const char *const wrong[] = {"width = (int) 16385", "height = (int) 16385", "views = (int) 65",
      "width = (int) 0", "views = (int) 0", "version = (int) 3", "version = (int) 5"};
  for (const char *field : wrong) {
    GstCaps *caps = coded_caps (ring_rig (1));
    GstStructure *one = gst_structure_from_string ((std::string ("x, ") + field).c_str (), nullptr);
    gst_structure_foreach (
        one,
        [] (GQuark id, const GValue *value, gpointer to) -> gboolean {
          gst_structure_id_set_value (static_cast<GstStructure *> (to), id, value);
          return TRUE;
        },
        gst_caps_get_structure (caps, 0));
    gst_structure_free (one);
    for (const char *name : {"neighbourcodedec", "rtpneighbourcodepay"}) {
      GstElement *element = gst_element_factory_make (name, nullptr);
      GstPad *pad = gst_element_get_static_pad (element, "sink");
      fail_if (gst_pad_query_accept_caps (pad, caps), "%s takes %s", name, field);
      gst_object_unref (pad);
      gst_object_unref (element);
    }
    gst_caps_unref (caps);
  }
}
GST_END_TEST;

/* ---- units ---- */

/* The least of slices: an empty ROI. */
static std::vector<guint8>
small_slice (guint8 view = 0)
{
  std::vector<guint8> unit (kSliceHeaderSize);
  SliceHeader h;
  h.view_id = view;
  h.depth_bits = 12;
  h.colour_bits = 6;
  write_slice_header (h, unit.size (), unit.data ());
  return unit;
}

static std::vector<guint8>
repeated (const std::vector<guint8> &unit, gsize count)
{
  std::vector<guint8> bytes;
  bytes.reserve (unit.size () * count);
  for (gsize i = 0; i < count; i++)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  return bytes;
}

GST_START_TEST (test_slices_beyond_131072_are_left_out_and_counted)
{
  AccessUnitDecoder decoder;
  fail_unless_ok (decoder.set_rig (ring_rig (1)));
  for (const gsize more : {0, 1, 1000}) {
    const std::vector<guint8> bytes = repeated (small_slice (), kMaxSlices + more);
    DecoderResult result;
    decoder.plan (bytes, result);
    fail_unless_equals_uint64 (result.bad_slices, more);
  }
}
GST_END_TEST;

GST_START_TEST (test_key_check_of_too_many_slices_says_no)
{
  KeyCheck check;
  SliceHeader slice;
  for (gsize i = 0; i < kMaxSlices; i++)
    check.add (slice);
  fail_unless (check.is_key ());
  check.add (slice);
  fail_if (check.is_key ());
}
GST_END_TEST;

GST_START_TEST (test_pixels_are_decoded_once)
{
  const Rig rig = ring_rig (1, 64, 48);
  const auto units = encoded_units (rig, make_frame_set (rig));
  std::vector<guint8> bytes;
  for (int i = 0; i < 12; i++)
    for (const auto &unit : units)
      bytes.insert (bytes.end (), unit.begin (), unit.end ());
  AccessUnitDecoder decoder;
  fail_unless_ok (decoder.set_rig (rig));
  DecoderResult result;
  decoder.plan (bytes, result);
  fail_unless_equals_int (decoder.views ().size (), 1);
  ck_assert_uint_le (decoder.views ()[0].held_pixels, 64 * 48);
}
GST_END_TEST;

/* ---- reassembly ---- */

/* The depayloader with packets of units, one access unit as long as one likes. */
struct Depay {
  GstHarness *h = gst_harness_new ("rtpneighbourcodedepay");
  guint16 sequence = 0;

  Depay ()
  {
    GstHarness *pay = gst_harness_new ("rtpneighbourcodepay");
    gst_harness_set_src_caps (pay, coded_caps (ring_rig (2)));
    GstBuffer *packet = gst_harness_push_and_pull (pay, buffer_of ({small_slice ()}));
    GstCaps *caps = gst_pad_get_current_caps (pay->sinkpad); /* with the rig */
    gst_harness_set_src_caps (h, caps);
    gst_buffer_unref (packet);
    gst_harness_teardown (pay);
  }
  ~Depay () { gst_harness_teardown (h); }
  Depay (const Depay &) = delete;
  Depay &operator= (const Depay &) = delete;

  void push (const std::vector<guint8> &units, bool marker, guint32 timestamp = 1)
  {
    GstBuffer *packet = gst_rtp_buffer_new_allocate (guint (units.size ()), 0, 0);
    GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
    fail_unless (gst_rtp_buffer_map (packet, GST_MAP_WRITE, &rtp));
    gst_rtp_buffer_set_payload_type (&rtp, 96);
    gst_rtp_buffer_set_seq (&rtp, sequence++);
    gst_rtp_buffer_set_timestamp (&rtp, timestamp);
    gst_rtp_buffer_set_marker (&rtp, marker);
    std::copy (
        units.begin (), units.end (), static_cast<guint8 *> (gst_rtp_buffer_get_payload (&rtp)));
    gst_rtp_buffer_unmap (&rtp);
    fail_unless_equals_int (gst_harness_push (h, packet), GST_FLOW_OK);
  }
  guint64 stat (const char *field) { return stats_field (h->element, field, "unit-stats"); }
};

/* A slice of the size of many. */
static std::vector<guint8>
long_slice ()
{
  std::vector<guint8> unit (60000);
  SliceHeader h;
  h.depth_bits = 12;
  h.colour_bits = 6;
  write_slice_header (h, unit.size (), unit.data ());
  return unit;
}

GST_START_TEST (test_access_unit_beyond_32_MiB_loses_the_rest_and_the_next_is_whole)
{
  Depay depay;
  const std::vector<guint8> unit = long_slice ();
  const gsize fit = kMaxAccessUnitSize / unit.size ();
  for (gsize i = 0; i < fit; i++)
    depay.push (unit, false);
  const gsize before = memory_in_use ();
  for (gsize i = 0; i < 2 * fit; i++)
    depay.push (unit, i + 1 == 2 * fit);
  fail_unless (kFreedMemoryStays || memory_in_use () < before + (8 << 20));
  GstBuffer *output = gst_harness_pull (depay.h);
  fail_unless_equals_uint64 (slices_of (output).size (), fit);
  gst_buffer_unref (output);
  fail_unless_equals_uint64 (depay.stat ("bad-units"), 2 * fit);
  depay.push (small_slice (), true, 2);
  output = gst_harness_pull (depay.h);
  fail_unless_equals_uint64 (slices_of (output).size (), 1);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_units_beyond_131072_are_dropped_and_counted)
{
  Depay depay;
  const gsize in_a_packet = 1024;
  const std::vector<guint8> units = repeated (small_slice (), in_a_packet);
  for (gsize i = 0; i < kMaxSlices / in_a_packet; i++)
    depay.push (units, false);
  fail_unless_equals_uint64 (depay.stat ("bad-units"), 0);
  depay.push (small_slice (), true);
  fail_unless_equals_uint64 (depay.stat ("bad-units"), 1);
  GstBuffer *output = gst_harness_pull (depay.h);
  fail_unless_equals_uint64 (slices_of (output).size (), kMaxSlices);
  gst_buffer_unref (output);
}
GST_END_TEST;

/* ---- byte streams ---- */

GST_START_TEST (test_access_unit_of_more_than_32_MiB_with_its_rig_is_an_error)
{
  AccessUnitWriter writer;
  writer.set_rig (gstrange::make_info (ring_rig (2), 25, 1));
  const gsize longest = writer.max_size ();
  for (const gsize more : {0, 1}) {
    const Status status = writer.begin (true, longest + more);
    fail_unless_equals_int (status.ok (), more == 0);
    if (status.ok ()) {
      GstBuffer *buffer = writer.finish (0);
      AccessUnitHeader header;
      fail_unless_ok (read_access_unit_header (bytes_of (buffer), header));
      gst_buffer_unref (buffer);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_header_that_promises_more_than_32_MiB_begins_nothing)
{
  AccessUnitHeader header, read;
  std::vector<guint8> bytes (kAccessUnitHeaderSize);
  for (const guint32 more : {0u, 1u}) {
    header.size = kMaxAccessUnitSize + more;
    write_access_unit_header (header, bytes.data ());
    fail_unless_equals_int (begins_access_unit (bytes, read), more == 0);
  }
}
GST_END_TEST;

GST_START_TEST (test_two_MiB_of_garbage_at_the_beginning_are_one_error)
{
  GstHarness *h = gst_harness_new ("neighbourcodeparse");
  gst_harness_set_src_caps_str (h, GST_NEIGHBOUR_CODE_STREAM_CAPS);
  {
    ErrorCounter errors (h);
    GstFlowReturn flow = GST_FLOW_OK;
    gsize pushed = 0;
    for (; flow == GST_FLOW_OK && pushed < (8 << 20); pushed += 65536) {
      GstBuffer *garbage = gst_buffer_new_allocate (nullptr, 65536, nullptr);
      gst_buffer_memset (garbage, 0, 0x77, 65536);
      flow = gst_harness_push (h, garbage);
    }
    fail_unless_equals_int (flow, GST_FLOW_ERROR);
    ck_assert_uint_ge (pushed, (2 << 20));
    ck_assert_uint_lt (pushed, (3 << 20));
    fail_unless_equals_int (errors.take (), 1);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
limits_suite ()
{
  Suite *suite = suite_create ("limits");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_rig_beyond_each_limit_is_refused);
  tcase_add_test (tc, test_rig_of_more_than_2_27_pixels_is_one_error_of_its_caps);
  tcase_add_test (tc, test_rig_file_beyond_4_MiB_is_refused_unread);
  tcase_add_test (tc, test_caps_beyond_the_templates_are_not_accepted);
  tcase_add_test (tc, test_slices_beyond_131072_are_left_out_and_counted);
  tcase_add_test (tc, test_key_check_of_too_many_slices_says_no);
  tcase_add_test (tc, test_pixels_are_decoded_once);
  tcase_add_test (tc, test_access_unit_beyond_32_MiB_loses_the_rest_and_the_next_is_whole);
  tcase_add_test (tc, test_units_beyond_131072_are_dropped_and_counted);
  tcase_add_test (tc, test_access_unit_of_more_than_32_MiB_with_its_rig_is_an_error);
  tcase_add_test (tc, test_header_that_promises_more_than_32_MiB_begins_nothing);
  tcase_add_test (tc, test_two_MiB_of_garbage_at_the_beginning_are_one_error);
  return suite;
}

GST_CHECK_MAIN (limits);
