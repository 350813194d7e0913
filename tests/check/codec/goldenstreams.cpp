/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Streams that were recorded once (tests/data) decode to what an independent decoder made of them,
 * whatever becomes of the code: a change of the bitstream cannot go unnoticed. */
#include "../rangecast-check.hpp"

#include <map>
#include <rangecast/geometry/paste.hpp>
#include <string>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr const char *kStreamCaps = "video/x-neighbour-code,version=4";

static std::string
read_data (const std::string &name)
{
  const gchar *source = g_getenv ("RANGECAST_SOURCE");
  const std::string path = std::string (source ? source : ".") + "/tests/data/" + name;
  gchar *content = nullptr;
  gsize size = 0;
  fail_unless (
      g_file_get_contents (path.c_str (), &content, &size, nullptr), "no %s", path.c_str ());
  std::string data (content, size);
  g_free (content);
  return data;
}

/* Digests by name, e.g. "exact-depth-0.raw", of a file as sha256sum writes it. */
static std::map<std::string, std::string>
expected_digests ()
{
  std::map<std::string, std::string> digests;
  gchar **lines = g_strsplit (read_data ("SHA256SUMS").c_str (), "\n", 0);
  for (gchar **line = lines; *line; line++) {
    const std::string text = *line;
    if (text.size () > 66)
      digests[text.substr (66)] = text.substr (0, 64);
  }
  g_strfreev (lines);
  return digests;
}

/* A harness of elements that read a byte stream, and the whole stream pushed into it. */
static GstHarness *
play (const char *elements, const std::string &stream, const char *sink_caps = nullptr)
{
  GstHarness *h = gst_harness_new_parse (elements);
  if (sink_caps)
    gst_harness_set_sink_caps_str (h, sink_caps);
  gst_harness_set_src_caps_str (h, kStreamCaps);
  GstSegment segment; /* as filesrc has it */
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  gst_harness_push (h, gst_buffer_new_memdup (stream.data (), stream.size ()));
  gst_harness_push_event (h, gst_event_new_eos ());
  return h;
}

/* Full pictures of one view, as tests/bitstream/decode.py writes them. */
struct Pictures {
  GChecksum *depth = g_checksum_new (G_CHECKSUM_SHA256);
  GChecksum *colour = g_checksum_new (G_CHECKSUM_SHA256);

  Pictures () = default;
  Pictures (const Pictures &) = delete;
  Pictures &operator= (const Pictures &) = delete;
  ~Pictures ()
  {
    g_checksum_free (depth);
    g_checksum_free (colour);
  }

  void add (const View &view, const ConstRangeImage &image)
  {
    const auto pixels = static_cast<std::size_t> (view.width * view.height);
    std::vector<std::uint16_t> depths (pixels);
    std::vector<Rgbx> colours (pixels);
    paste_depth (image, {depths.data (), view.width, view.height, 2 * view.width});
    paste_colour (image, true, {colours.data (), view.width, view.height, 4 * view.width});
    std::vector<guchar> bytes;
    for (const std::uint16_t d : depths)
      for (const int byte : {d & 255, d >> 8})
        bytes.push_back (static_cast<guchar> (byte));
    g_checksum_update (depth, bytes.data (), gssize (bytes.size ()));
    bytes.clear ();
    for (const Rgbx &c : colours)
      bytes.insert (bytes.end (), {c.r, c.g, c.b});
    g_checksum_update (colour, bytes.data (), gssize (bytes.size ()));
  }
};

static void
expect_digests (const std::string &name, int views = 2)
{
  GstHarness *h = play ("neighbourcodeparse ! neighbourcodedec", read_data (name + ".rcnc"));
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  fail_unless (caps != nullptr);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  gst_caps_unref (caps);
  std::map<int, Pictures> pictures; /* by view-id */
  while (GstBuffer *buffer = gst_harness_try_pull (h)) {
    {
      const gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
      fail_unless_ok (frame.status ());
      for (const View &view : info.rig.views) {
        ConstRangeImage image; /* empty where the view did not come */
        for (const RangeImage &one : frame.views ())
          if (one.view_id == view.id)
            image = one;
        pictures[view.id].add (view, image);
      }
    }
    gst_buffer_unref (buffer);
  }
  gst_harness_teardown (h);

  const auto expected = expected_digests ();
  fail_unless_equals_int (pictures.size (), views);
  for (const auto &[id, picture] : pictures)
    for (const auto &[kind, checksum] :
        {std::pair{"depth", picture.depth}, {"colour", picture.colour}}) {
      const std::string key = name + "-" + kind + "-" + std::to_string (id) + ".raw";
      fail_unless (expected.count (key) == 1, "no digest of %s", key.c_str ());
      fail_unless (expected.at (key) == g_checksum_get_string (checksum),
          "%s is not what it was: %s", key.c_str (), g_checksum_get_string (checksum));
    }
}

GST_START_TEST (test_streams_decode_as_ever)
{
  for (const char *name : {"default", "packed", "entropy", "exact", "exact-packed", "coarse",
           "damaged", "rules-depth", "rules-rig", "rules-slices"})
    expect_digests (name);
  for (const char *name :
      {"temporal-packed", "temporal-entropy", "temporal-lossy", "rules-damage", "rules-entropy",
          "rules-examples", "rules-motion", "rules-packed", "rules-references", "rules-stream"})
    expect_digests (name, 1);
}
GST_END_TEST;

/* Without thresholds nothing is lost, so that the encoder must give the file back. */
GST_START_TEST (test_exact_pictures_are_coded_as_ever)
{
  const std::string stream = read_data ("exact.rcnc");
  GstHarness *h = play ("neighbourcodeparse ! neighbourcodedec ! neighbourcodeenc profile=plain "
                        "depth-bits=16 depth-threshold=0 colour-threshold=0 max-slice-size=256 ! "
                        "neighbourcodeparse",
      stream, kStreamCaps);
  std::string coded;
  while (GstBuffer *buffer = gst_harness_try_pull (h)) {
    const std::size_t begin = coded.size ();
    coded.resize (begin + gst_buffer_get_size (buffer));
    gst_buffer_extract (buffer, 0, coded.data () + begin, coded.size () - begin);
    gst_buffer_unref (buffer);
  }
  gst_harness_teardown (h);
  fail_unless_cmp (coded, ==, stream);
}
GST_END_TEST;

static Suite *
goldenstreams_suite ()
{
  Suite *suite = suite_create ("goldenstreams");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_streams_decode_as_ever);
  tcase_add_test (tc, test_exact_pictures_are_coded_as_ever);
  return suite;
}

GST_CHECK_MAIN (goldenstreams);
