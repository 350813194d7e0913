/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Speech beside the frame sets: from the stream, from RTP, or from the file beside a recording. */
#include "viewer.hpp"

#include <filesystem>

namespace {

const char kSpeechCaps[] =
    "application/x-rtp,media=audio,clock-rate=48000,encoding-name=OPUS,payload=111,"
    "extmap-2=(string)urn:ietf:params:rtp-hdrext:ntp-64";

/* The name of the file with the speech of a recording: x.opus beside x.rcnc, and x.opus~ beside
 * x.rcnc~, which rangecast record keeps of the recording before. */
std::string
speech_beside (std::string recording)
{
  const bool saved = recording.ends_with ('~');
  if (saved)
    recording.pop_back ();
  return std::filesystem::path (recording).replace_extension (".opus").string () +
         (saved ? "~" : "");
}

} // namespace

bool
hear (Viewer &viewer, GstPad *pad)
{
  if (viewer.hears.exchange (true))
    return false; /* one voice is heard already */
  GstElement *queue = add_element (viewer, "queue"),
             *convert = add_element (viewer, "audioconvert"),
             *resample = add_element (viewer, "audioresample"),
             *volume = add_element (viewer, "volume"),
             *sink = add_element (viewer, "autoaudiosink");
  g_object_set (queue, "max-size-time", 2 * GST_SECOND, "max-size-buffers", 0, nullptr);
  gst_element_link_many (queue, convert, resample, volume, sink, nullptr);
  for (GstElement *element : {sink, volume, resample, convert, queue})
    gst_element_sync_state_with_parent (element);
  GstPad *first = gst_element_get_static_pad (queue, "sink");
  const bool linked = gst_pad_link (pad, first) == GST_PAD_LINK_OK;
  gst_object_unref (first);
  viewer.volume = volume;
  return linked;
}

void
toggle_mute (Viewer &viewer)
{
  if (!viewer.volume) {
    viewer.overlay->say ("no sound");
    return;
  }
  gboolean mute = FALSE;
  g_object_get (viewer.volume.load (), "mute", &mute, nullptr);
  g_object_set (viewer.volume.load (), "mute", !mute, nullptr);
  viewer.overlay->say (mute ? "sound on" : "sound off");
}

void
build_speech_receiver (Viewer &viewer, GstElement *before, GstElement *after)
{
  GstElement *source = add_element (viewer, "udpsrc"),
             *guard = add_element (viewer, "rtpneighbourcodeguard"),
             *jitter = add_element (viewer, "rtpjitterbuffer"),
             *depayloader = add_element (viewer, "rtpopusdepay"),
             *step = add_element (viewer, "capturesync"),
             *decoder = add_element (viewer, "opusdec");
  GstCaps *caps = gst_caps_from_string (kSpeechCaps);
  g_object_set (source, "port", viewer.options.audio, "reuse", FALSE, "caps", caps, nullptr);
  gst_caps_unref (caps);
  g_object_set (jitter, "latency", viewer.options.latency_ms, "do-lost", TRUE, "max-dropout-time",
      1000, "max-misorder-time", 500, nullptr);
  g_object_set (decoder, "plc", TRUE, "tolerance", gint64 (5 * GST_MSECOND), nullptr);
  gst_element_link_pads (before, "src", step, "sink_0");
  gst_element_link_pads (step, "src_0", after, "sink");
  gst_element_link_many (source, guard, jitter, depayloader, nullptr);
  gst_element_link_pads (depayloader, "src", step, "sink_1");
  GstElement *queue = add_element (viewer, "queue");
  g_object_set (queue, "max-size-time", 2 * GST_SECOND, "max-size-buffers", 0, nullptr);
  gst_element_link_pads (step, "src_1", queue, "sink");
  gst_element_link (queue, decoder);
  /* Silence while no speech arrives, for which the picture would wait. */
  GstElement *silence = add_element (viewer, "audiotestsrc"),
             *mixer = add_element (viewer, "audiomixer");
  g_object_set (silence, "is-live", TRUE, nullptr);
  gst_util_set_object_arg (G_OBJECT (silence), "wave", "silence");
  gst_element_link_many (decoder, add_element (viewer, "audioconvert"),
      add_element (viewer, "audioresample"), mixer, nullptr);
  gst_element_link_many (silence, mixer, nullptr);
  GstPad *pad = gst_element_get_static_pad (mixer, "src");
  hear (viewer, pad);
  gst_object_unref (pad);
}

std::string
find_speech (const Viewer &viewer)
{
  if (!viewer.is_file || gst_uri_is_valid (viewer.options.inputs[0]))
    return "";
  const std::string path = speech_beside (viewer.options.inputs[0]);
  const bool found =
      path != viewer.options.inputs[0] && g_file_test (path.c_str (), G_FILE_TEST_IS_REGULAR);
  return found ? path : "";
}
