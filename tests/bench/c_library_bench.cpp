/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How long librangecast takes to decode a recording, beside neighbourcodedec in the same process.
 * --help lists the options. */
#include <gst/check/gstharness.h>
#include <rangecast.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "options.hpp"

namespace {

const char *const kUsage = "usage: c_library_bench --recording FILE.rcnc [--rounds N]\n"
                           "  --rounds N  of both, one after the other (default 15)\n"
                           "columns: milliseconds of CPU a frame set, medians, of neighbourcodedec "
                           "and librangecast, both\n"
                           "with one thread, and the median of their ratios\n";

/* Access units as neighbourcodeparse outputs them, and their caps. */
struct Recording {
  std::vector<GstBuffer *> units;
  GstCaps *caps = nullptr;

  explicit Recording (const std::string &path)
  {
    gchar *data = nullptr;
    gsize size = 0;
    if (!g_file_get_contents (path.c_str (), &data, &size, nullptr))
      return;
    GstHarness *h = gst_harness_new ("neighbourcodeparse");
    gst_harness_set_src_caps_str (h, "video/x-neighbour-code,version=4,alignment=byte-stream");
    gst_harness_push (h, gst_buffer_new_wrapped (data, size));
    gst_harness_push_event (h, gst_event_new_eos ());
    while (GstBuffer *unit = gst_harness_try_pull (h))
      units.push_back (unit);
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
  }
  ~Recording ()
  {
    for (GstBuffer *unit : units)
      gst_buffer_unref (unit);
    gst_caps_replace (&caps, nullptr);
  }
  Recording (const Recording &) = delete;
  Recording &operator= (const Recording &) = delete;
};

/* CPU time of the thread: both decode in the one that calls them. */
double
now_ms ()
{
  timespec time{};
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &time);
  return double (time.tv_sec) * 1e3 + double (time.tv_nsec) * 1e-6;
}

/* Milliseconds a frame set. Both forget the round before, whose frame sets are later than what
 * comes. */
double
element_ms (GstHarness *h, const Recording &recording)
{
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  const double begin = now_ms ();
  for (GstBuffer *unit : recording.units) {
    gst_harness_push (h, gst_buffer_ref (unit));
    if (GstBuffer *frame_set = gst_harness_try_pull (h))
      gst_buffer_unref (frame_set);
  }
  return (now_ms () - begin) / double (recording.units.size ());
}

double
library_ms (RangecastDecoder *decoder, const Recording &recording)
{
  rangecast_decoder_reset (decoder);
  RangecastFrameSet frame_set{};
  frame_set.struct_size = sizeof frame_set;
  const double begin = now_ms ();
  std::size_t decoded = 0;
  for (GstBuffer *unit : recording.units) {
    GstMapInfo map;
    gst_buffer_map (unit, &map, GST_MAP_READ);
    rangecast_decoder_push_bytes (decoder, map.data, map.size);
    gst_buffer_unmap (unit, &map);
    if (rangecast_decoder_next (decoder) == RANGECAST_OK &&
        rangecast_decoder_get_frame_set (decoder, &frame_set) == RANGECAST_OK)
      decoded += frame_set.n_unknown == 0;
  }
  const double took = now_ms () - begin;
  if (decoded != recording.units.size ())
    g_error ("librangecast decoded %zu of %zu frame sets", decoded, recording.units.size ());
  return took / double (decoded);
}

double
median (std::vector<double> values)
{
  std::ranges::sort (values);
  return values[values.size () / 2];
}

} // namespace

int
main (int argc, char **argv)
{
  std::string path;
  int rounds = 15;
  Options options ("c_library_bench", kUsage);
  options.text ("--recording", path);
  options.number ("--rounds", rounds, 1, 1000);
  if (const auto status = options.parse (argc, argv))
    return *status;
  gst_init (&argc, &argv);
  const Recording recording (path);
  if (recording.units.empty ())
    return options.refuse ("--recording: expected a recording (.rcnc), got '" + path + "'");
  GstHarness *h = gst_harness_new_parse ("neighbourcodedec n-threads=1");
  gst_harness_set_src_caps (h, gst_caps_ref (recording.caps));
  RangecastDecoder *decoder = rangecast_decoder_new (1);
  element_ms (h, recording), library_ms (decoder, recording);
  std::vector<double> element, library, ratio;
  for (int i = 0; i < rounds; i++) {
    element.push_back (element_ms (h, recording));
    library.push_back (library_ms (decoder, recording));
    ratio.push_back (library.back () / element.back ());
  }
  std::printf ("%.3f %.3f %.3f\n", median (element), median (library), median (ratio));
  rangecast_decoder_free (decoder);
  gst_harness_teardown (h);
}
