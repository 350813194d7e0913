/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests of neighbourcodeparse share: recordings, and a player of files. */
#pragma once

#include "../coded-check.hpp"

#include <glib/gstdio.h>
#include <gst/base/base.h>

#include <algorithm>

namespace rangecast::testing {

inline constexpr GstClockTime kFrame = GST_SECOND / 25;
inline constexpr const char *kStreamCaps = "video/x-neighbour-code,version=4";

/** Coded frame sets as access units and as a byte stream. */
struct Recording {
  Rig rig;
  std::vector<GstBuffer *> access_units;
  std::vector<guint8> bytes;
  std::vector<gsize> offsets; /* of the access units in the bytes */

  explicit Recording (int frames = 10, int width = 64, GstClockTime start = GST_SECOND)
      : rig (ring_rig (2, width, width * 3 / 4))
  {
    GstHarness *encoder = harness_of ("neighbourcodeenc profile=plain");
    gst_harness_set_src_caps (
        encoder, gstrange::make_range_caps (gstrange::make_info (rig, 25, 1)));
    for (int i = 0; i < frames; i++) {
      access_units.push_back (
          gst_harness_push_and_pull (encoder, make_frame_set (rig, start + i * kFrame)));
      const auto coded = bytes_of (access_units.back ());
      offsets.push_back (bytes.size ());
      bytes.insert (bytes.end (), coded.begin (), coded.end ());
    }
    gst_harness_teardown (encoder);
  }
  Recording (const Recording &) = delete;
  ~Recording ()
  {
    for (GstBuffer *buffer : access_units)
      gst_buffer_unref (buffer);
  }
};

/** A parser that is fed as filesrc feeds it. */
inline GstHarness *
new_parser ()
{
  GstHarness *h = harness_of ("neighbourcodeparse");
  gst_harness_set_src_caps_str (h, kStreamCaps);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  return h;
}

inline void
push_bytes (GstHarness *h, std::span<const guint8> bytes, gsize piece)
{
  for (gsize at = 0; at < bytes.size (); at += piece)
    gst_harness_push (
        h, gst_buffer_new_memdup (bytes.data () + at, std::min (piece, bytes.size () - at)));
}

/** What the parser gives for a file of these bytes, read in pieces. */
inline std::vector<GstBuffer *>
parse (std::span<const guint8> bytes, gsize piece)
{
  GstHarness *h = new_parser ();
  push_bytes (h, bytes, piece);
  gst_harness_push_event (h, gst_event_new_eos ());
  auto parsed = pull_all (h);
  gst_harness_teardown (h);
  return parsed;
}

inline bool
same_bytes (GstBuffer *a, GstBuffer *b)
{
  GstMapInfo map;
  gst_buffer_map (a, &map, GST_MAP_READ);
  const bool same =
      map.size == gst_buffer_get_size (b) && gst_buffer_memcmp (b, 0, map.data, map.size) == 0;
  gst_buffer_unmap (a, &map);
  return same;
}

/** Only every fifth access unit says that it decodes without the ones before. */
inline std::vector<guint8>
with_delta_units (const Recording &recording)
{
  auto bytes = recording.bytes;
  for (gsize i = 0; i < recording.offsets.size (); i++)
    if (i % 5)
      bytes[recording.offsets[i] + 1] = 0;
  return bytes;
}

/** Without presentation times in the headers. */
inline std::vector<guint8>
without_times (const Recording &recording)
{
  auto bytes = recording.bytes;
  for (gsize offset : recording.offsets)
    std::fill_n (bytes.begin () + std::ptrdiff_t (offset) + 12, 8, guint8{0xff});
  return bytes;
}

/** A file that is gone with its scope. */
struct TemporaryFile {
  std::string path;

  explicit TemporaryFile (std::span<const guint8> bytes)
  {
    gchar *name = nullptr;
    const gint fd = g_file_open_tmp ("neighbourcodeparse-XXXXXX", &name, nullptr);
    ck_assert_int_ge (fd, 0);
    g_close (fd, nullptr);
    path = name;
    g_free (name);
    fail_unless (g_file_set_contents (
        path.c_str (), reinterpret_cast<const gchar *> (bytes.data ()), bytes.size (), nullptr));
  }
  TemporaryFile (const TemporaryFile &) = delete;
  ~TemporaryFile () { g_unlink (path.c_str ()); }
};

/** filesrc ! between ! neighbourcodeparse ! after fakesink, paused on its first buffer. */
struct Player {
  GstElement *pipeline, *sink;
  std::vector<GstClockTime> seen; /* times of what reached the sink since the last seek */
  std::vector<int> widths;        /* caps that reached it */

  explicit Player (
      const TemporaryFile &file, const char *between = "", const std::string &after = "")
  {
    const std::string line = "filesrc name=file ! " + std::string (between) +
                             " neighbourcodeparse ! " + after + " fakesink name=sink sync=false";
    pipeline = gst_parse_launch (line.c_str (), nullptr);
    GstElement *source = gst_bin_get_by_name (GST_BIN (pipeline), "file");
    g_object_set (source, "location", file.path.c_str (), nullptr);
    gst_object_unref (source);
    sink = gst_bin_get_by_name (GST_BIN (pipeline), "sink");
    GstPad *pad = gst_element_get_static_pad (sink, "sink");
    gst_pad_add_probe (pad,
        GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM), &note,
        this, nullptr);
    gst_object_unref (pad);
    gst_element_set_state (pipeline, GST_STATE_PAUSED);
  }
  Player (const Player &) = delete;
  ~Player ()
  {
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (sink);
    gst_object_unref (pipeline);
  }

  static GstPadProbeReturn note (GstPad *, GstPadProbeInfo *info, gpointer data)
  {
    auto self = static_cast<Player *> (data);
    if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
      self->seen.push_back (GST_BUFFER_PTS (GST_PAD_PROBE_INFO_BUFFER (info)));
      return GST_PAD_PROBE_OK;
    }
    GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
    GstCaps *caps = nullptr;
    int width = 0;
    if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
      gst_event_parse_caps (event, &caps);
      gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &width);
      self->widths.push_back (width);
    }
    return GST_PAD_PROBE_OK;
  }

  bool wait ()
  {
    return gst_element_get_state (pipeline, nullptr, nullptr, 10 * GST_SECOND) ==
           GST_STATE_CHANGE_SUCCESS;
  }
  bool seek (GstClockTime time, int flags)
  {
    return seek_part (time, flags, GST_SEEK_TYPE_SET, GST_CLOCK_TIME_NONE);
  }
  /* The same for a part of the file, that ends at `stop`. */
  bool seek_part (GstClockTime time, int flags, GstSeekType stop_type, GstClockTime stop)
  {
    if (!wait ())
      return false;
    seen.clear ();
    return gst_element_seek (pipeline, 1, GST_FORMAT_TIME,
               GstSeekFlags (GST_SEEK_FLAG_FLUSH | flags), GST_SEEK_TYPE_SET, gint64 (time),
               stop_type, gint64 (stop)) &&
           wait ();
  }
  /* The buffer that the sink is paused on. */
  GstClockTime shown ()
  {
    GstSample *sample = nullptr;
    g_object_get (sink, "last-sample", &sample, nullptr);
    const GstClockTime pts =
        sample ? GST_BUFFER_PTS (gst_sample_get_buffer (sample)) : GST_CLOCK_TIME_NONE;
    if (sample)
      gst_sample_unref (sample);
    return pts;
  }
  gint64 position ()
  {
    gint64 value = -1;
    gst_element_query_position (pipeline, GST_FORMAT_TIME, &value);
    return value;
  }
  gint64 duration ()
  {
    gint64 value = -1;
    gst_element_query_duration (pipeline, GST_FORMAT_TIME, &value);
    return value;
  }
  /* Plays to the end; false if an error came. */
  bool finish ()
  {
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    GstBus *bus = gst_element_get_bus (pipeline);
    GstMessage *message = gst_bus_timed_pop_filtered (
        bus, 30 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
    const bool eos = message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS;
    if (message)
      gst_message_unref (message);
    gst_object_unref (bus);
    return eos;
  }
};

} // namespace rangecast::testing
