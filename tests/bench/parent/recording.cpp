/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "recording.hpp"

#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include <algorithm>
#include <map>
#include <rangecast/neighbourcode/bitstream/unit.hpp>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

constexpr std::size_t kRtpHeaderSize = 12;
constexpr std::size_t kCaptureOffset = 12; /* of a slice, docs/formats/bitstream.md */

double
Recording::packets_per_frame () const
{
  std::size_t n = 0;
  for (const auto &view : views)
    for (const auto &frame : view)
      n += frame.size ();
  return double (n) / double (std::max<std::size_t> (frames (), 1));
}

double
Recording::bytes_per_frame () const
{
  std::size_t n = 0;
  for (const auto &view : views)
    for (const auto &frame : view)
      for (const Packet &packet : frame)
        n += packet.bytes.size ();
  return double (n) / double (std::max<std::size_t> (frames (), 1));
}

std::size_t
Recording::slices (std::size_t frame) const
{
  std::size_t n = 0;
  for (const auto &view : views)
    for (const Packet &packet : view[frame])
      n += packet.capture_fields.size ();
  return n;
}

std::vector<std::uint16_t>
find_capture_fields (const std::uint8_t *packet, std::size_t size)
{
  std::vector<std::uint16_t> offsets;
  if (size < kRtpHeaderSize)
    return offsets;
  rangecast::UnitReader reader ({packet + kRtpHeaderSize, size - kRtpHeaderSize});
  rangecast::UnitHeader header;
  while (const auto unit = reader.next (header))
    if (header.type == std::uint8_t (rangecast::UnitType::kSlice) &&
        unit->size () >= rangecast::kSliceHeaderSize)
      offsets.push_back (std::uint16_t (unit->data () - packet + kCaptureOffset));
  return offsets;
}

namespace {

/* The pipeline that takes a file apart: one payloader and sink a view. */
struct Unpacker {
  GstElement *pipeline;
  std::map<std::string, GstElement *> sinks; /* by name of the pad: src_10 is behind src_2 here */
};

void
add_view (GstElement *, GstPad *pad, Unpacker *self)
{
  GstElement *pay = gst_element_factory_make ("rtpneighbourcodepay", nullptr);
  GstElement *sink = gst_element_factory_make ("appsink", nullptr);
  g_object_set (sink, "sync", FALSE, "async", FALSE, "wait-on-eos", FALSE, nullptr);
  gst_bin_add_many (GST_BIN (self->pipeline), pay, sink, nullptr);
  gst_element_link (pay, sink);
  gst_element_sync_state_with_parent (sink);
  gst_element_sync_state_with_parent (pay);
  GstPad *to = gst_element_get_static_pad (pay, "sink");
  gst_pad_link (pad, to);
  gst_object_unref (to);
  self->sinks[GST_PAD_NAME (pad)] = sink;
}

std::vector<std::vector<Packet>>
frames_of (GstElement *sink)
{
  std::vector<std::vector<Packet>> frames;
  GstClockTime last = GST_CLOCK_TIME_NONE;
  while (GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (sink), 0)) {
    GstBuffer *buffer = gst_sample_get_buffer (sample);
    if (frames.empty () || GST_BUFFER_PTS (buffer) != last)
      frames.emplace_back ();
    last = GST_BUFFER_PTS (buffer);
    Packet packet;
    packet.bytes.resize (gst_buffer_get_size (buffer));
    gst_buffer_extract (buffer, 0, packet.bytes.data (), packet.bytes.size ());
    packet.capture_fields = find_capture_fields (packet.bytes.data (), packet.bytes.size ());
    frames.back ().push_back (std::move (packet));
    gst_sample_unref (sample);
  }
  return frames;
}

Status
run (GstElement *pipeline, const std::string &path)
{
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 60 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  gst_object_unref (bus);
  Status status{StatusCode::kBadData, path + ": does not end"};
  if (message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS)
    status = {};
  if (message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR) {
    GError *error = nullptr;
    gst_message_parse_error (message, &error, nullptr);
    status = {StatusCode::kBadData, path + ": " + error->message};
    g_error_free (error);
  }
  if (message)
    gst_message_unref (message);
  return status;
}

} // namespace

/* Backgrounds are learnt from frame sets of which nothing is left. */
static void
leave_out_empty_beginning (Recording &recording)
{
  const auto is_empty = [&] (std::size_t frame) {
    for (const auto &view : recording.views)
      for (const Packet &packet : view[frame])
        if (packet.bytes.size () > kRtpHeaderSize + rangecast::kSliceHeaderSize)
          return false;
    return true;
  };
  std::size_t first = 1; /* the first one has the rig, too */
  while (first < recording.frames () && is_empty (first))
    first++;
  if (first == 1 || first == recording.frames ())
    return;
  for (auto &view : recording.views)
    view.erase (view.begin (), view.begin () + std::ptrdiff_t (first));
}

Status
read_recording (const std::string &path, Recording &recording)
{
  if (!g_file_test (path.c_str (), G_FILE_TEST_IS_REGULAR))
    return {StatusCode::kNotFound, path + ": no such file"};
  GError *error = nullptr;
  GstElement *pipeline =
      gst_parse_launch ("filesrc name=file ! neighbourcodeparse ! rangedemux name=demux", &error);
  if (!pipeline || error) {
    const std::string text = error ? error->message : "no pipeline";
    g_clear_error (&error);
    return {StatusCode::kNotFound, text};
  }
  Unpacker unpacker{pipeline, {}};
  GstElement *file = gst_bin_get_by_name (GST_BIN (pipeline), "file");
  GstElement *demux = gst_bin_get_by_name (GST_BIN (pipeline), "demux");
  g_object_set (file, "location", path.c_str (), nullptr);
  g_signal_connect (demux, "pad-added", G_CALLBACK (add_view), &unpacker);
  gst_object_unref (file);
  gst_object_unref (demux);
  Status status = run (pipeline, path);
  recording = {};
  std::size_t frames = SIZE_MAX;
  for (const auto &[name, sink] : unpacker.sinks) {
    recording.views.push_back (frames_of (sink));
    frames = std::min (frames, recording.views.back ().size ());
  }
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  if (status.ok () && (recording.views.empty () || frames == 0))
    status = {StatusCode::kBadData, path + ": no frame sets of all views"};
  for (auto &view : recording.views)
    view.resize (std::min (frames, view.size ()));
  if (status.ok ())
    leave_out_empty_beginning (recording);
  return status;
}

} // namespace bench
