/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "keep-alive.hpp"

#include <chrono>

#include "media.hpp"

namespace {

const char kReleasedKey[] = "rangecast-released"; /* object data of a media: is not held again */

GstRTSPTransport *
make_transport (GstRTSPLowerTrans lower)
{
  GstRTSPTransport *transport = nullptr;
  gst_rtsp_transport_new (&transport);
  transport->trans = GST_RTSP_TRANS_RTP;
  transport->profile = GST_RTSP_PROFILE_AVPF;
  transport->lower_transport = lower;
  return transport;
}

void
make_sinks (GstRTSPStream *stream, GstRTSPLowerTrans lower)
{
  GstRTSPTransport *transport = make_transport (lower);
  bool has_sockets = false;
  for (GSocketFamily family : {G_SOCKET_FAMILY_IPV4, G_SOCKET_FAMILY_IPV6}) {
    if (!gst_rtsp_stream_allocate_udp_sockets (stream, family, transport, FALSE))
      continue; /* the host lacks this address family */
    has_sockets = true;
    if (lower == GST_RTSP_LOWER_TRANS_UDP_MCAST)
      if (GstRTSPAddress *group = gst_rtsp_stream_get_multicast_address (stream, family)) {
        transport->ttl = group->ttl;
        gst_rtsp_address_free (group);
      }
  }
  if (has_sockets)
    gst_rtsp_stream_complete_stream (stream, transport);
  else
    g_printerr (
        "rtsp-server: warning: no sockets for %s; a viewer that joins that way may interrupt the "
        "stream\n",
        lower == GST_RTSP_LOWER_TRANS_UDP ? "UDP" : "multicast");
  gst_rtsp_transport_free (transport);
}

/* gst-rtsp-server 1.22 makes the sinks of a lower transport when its first viewer joins. In a
 * running pipeline it links their queue before it sets its state: a packet that arrives in between
 * is refused (FLUSHING), which ends the stream for all viewers without a message. */
void
make_all_sinks (GstRTSPMedia *media)
{
  const GstRTSPLowerTrans served = gst_rtsp_media_get_protocols (media);
  for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++)
    for (GstRTSPLowerTrans lower : {GST_RTSP_LOWER_TRANS_UDP, GST_RTSP_LOWER_TRANS_UDP_MCAST})
      if (served & lower)
        make_sinks (gst_rtsp_media_get_stream (media, i), lower);
}

/* A TCP transport that discards packets. */
GstRTSPStreamTransport *
make_null_transport (GstRTSPStream *stream)
{
  GstRTSPTransport *transport = make_transport (GST_RTSP_LOWER_TRANS_TCP);
  transport->interleaved = {0, 1};
  transport->destination = g_strdup ("nobody"); /* compared with the address of RTCP packets */
  GstRTSPStreamTransport *null = gst_rtsp_stream_transport_new (stream, transport);
  const auto discard = [] (GstBuffer *, guint8, gpointer) -> gboolean { return TRUE; };
  const auto discard_list = [] (GstBufferList *, guint8, gpointer) -> gboolean { return TRUE; };
  gst_rtsp_stream_transport_set_callbacks (null, discard, discard, nullptr, nullptr);
  gst_rtsp_stream_transport_set_list_callbacks (null, discard_list, discard_list, nullptr, nullptr);
  return null;
}

void
deactivate (GPtrArray *transports)
{
  for (guint i = 0; i < transports->len; i++)
    gst_rtsp_stream_transport_set_active (
        GST_RTSP_STREAM_TRANSPORT (g_ptr_array_index (transports, i)), FALSE);
}

} // namespace

bool
MediaKeepAlive::hold (GstRTSPMedia *media)
{
  {
    std::unique_lock guard (lock_);
    /* a viewer must not play before the media has its sinks */
    changed_.wait_for (guard, std::chrono::seconds (1),
        [&] { return media_ != media || phase_ != Phase::kPreparing; });
    if (media_ || g_object_get_data (G_OBJECT (media), kReleasedKey))
      return media_ == media;
    media_ = GST_RTSP_MEDIA (g_object_ref (media));
    phase_ = Phase::kPreparing;
    released_ = false;
  }
  GPtrArray *transports = nullptr;
  if (gst_rtsp_media_prepare (media, nullptr)) {
    transports = g_ptr_array_new_with_free_func (g_object_unref);
    for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++)
      g_ptr_array_add (transports, make_null_transport (gst_rtsp_media_get_stream (media, i)));
    make_all_sinks (media);
    disable_live_sync (media);
    gst_rtsp_media_complete_pipeline (media, transports);
  }
  std::unique_lock guard (lock_);
  transports_ = transports;
  phase_ = Phase::kHeld;
  changed_.notify_all ();
  if (transports && !released_)
    return true;
  release_held (guard);
  return false;
}

void
MediaKeepAlive::start (GstRTSPMedia *media)
{
  GPtrArray *transports = nullptr;
  {
    std::lock_guard guard (lock_);
    if (media_ != media || phase_ != Phase::kHeld)
      return;
    phase_ = Phase::kStarted;
    transports = g_ptr_array_ref (transports_);
  }
  gst_rtsp_media_set_state (media, GST_STATE_PLAYING, transports);
  std::lock_guard guard (lock_);
  if (media_ != media) /* released meanwhile: its streams must not keep transports */
    deactivate (transports);
  g_ptr_array_unref (transports);
}

bool
MediaKeepAlive::has_started (GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  return media_ == media && phase_ == Phase::kStarted;
}

/* With the lock, which is not held while the media stops. */
void
MediaKeepAlive::release_held (std::unique_lock<std::mutex> &guard)
{
  GstRTSPMedia *media = media_;
  GPtrArray *transports = transports_;
  media_ = nullptr;
  transports_ = nullptr;
  phase_ = Phase::kNone;
  if (!media)
    return;
  releasing_++;
  guard.unlock ();
  if (transports) {
    deactivate (transports);
    gst_rtsp_media_unprepare (media);
    g_ptr_array_unref (transports);
  }
  g_object_unref (media);
  guard.lock ();
  releasing_--;
  changed_.notify_all ();
}

void
MediaKeepAlive::release (GstRTSPMedia *only)
{
  std::unique_lock guard (lock_);
  if (only)
    g_object_set_data (G_OBJECT (only), kReleasedKey, only);
  if (only && media_ != only)
    return;
  if (phase_ == Phase::kPreparing)
    released_ = true; /* hold() releases it */
  else
    release_held (guard);
}

void
MediaKeepAlive::release_unless_asked_since (gint64 monotonic_us)
{
  std::unique_lock guard (lock_);
  if (requested_at_us_ < monotonic_us && phase_ != Phase::kPreparing)
    release_held (guard);
}

void
MediaKeepAlive::record_request ()
{
  std::unique_lock guard (lock_);
  requested_at_us_ = g_get_monotonic_time ();
  changed_.wait (guard, [this] { return releasing_ == 0; });
}

bool
MediaKeepAlive::holds_any ()
{
  std::lock_guard guard (lock_);
  return media_ != nullptr;
}
