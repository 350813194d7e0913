/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Small things between C++ and gst-rtsp-server. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <memory>
#include <vector>

/** GDestroyNotify for what `new` made. */
template <typename T>
void
delete_data (gpointer data)
{
  delete static_cast<T *> (data);
}

/** GClosureNotify for what `new` made. */
template <typename T>
void
delete_closure_data (gpointer data, GClosure *)
{
  delete static_cast<T *> (data);
}

/** Transfer full; nullptr once the media has none. */
inline GstElement *
pipeline_of (GstRTSPMedia *media)
{
  GstElement *bin = gst_rtsp_media_get_element (media);
  GstObject *pipeline = gst_object_get_parent (GST_OBJECT (bin));
  gst_object_unref (bin);
  return pipeline ? GST_ELEMENT (pipeline) : nullptr;
}

struct TransportUnref {
  void operator() (GstRTSPStreamTransport *transport) const { g_object_unref (transport); }
};
using TransportRef = std::unique_ptr<GstRTSPStreamTransport, TransportUnref>;

/** The transports of a session's media that have this lower transport. */
inline std::vector<TransportRef>
transports_of (GstRTSPSessionMedia *media, GstRTSPLowerTrans lower)
{
  std::vector<TransportRef> found;
  GPtrArray *transports = gst_rtsp_session_media_get_transports (media);
  for (guint i = 0; i < transports->len; i++) {
    auto transport = static_cast<GstRTSPStreamTransport *> (g_ptr_array_index (transports, i));
    const GstRTSPTransport *to =
        transport ? gst_rtsp_stream_transport_get_transport (transport) : nullptr;
    if (to && to->lower_transport == lower)
      found.emplace_back (GST_RTSP_STREAM_TRANSPORT (g_object_ref (transport)));
  }
  g_ptr_array_unref (transports);
  return found;
}
