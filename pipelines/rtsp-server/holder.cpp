/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "holder.hpp"

#include <chrono>

#include "media.hpp"

static const char kReleasedKey[] = "rangecast-released"; /* of a media: is not held again */

static GstRTSPTransport *
make_transport (GstRTSPLowerTrans lower)
{
  GstRTSPTransport *transport = nullptr;
  gst_rtsp_transport_new (&transport);
  transport->trans = GST_RTSP_TRANS_RTP;
  transport->profile = GST_RTSP_PROFILE_AVPF;
  transport->lower_transport = lower;
  return transport;
}

/* A stream's sinks for UDP, so that they need not be made when the first such viewer joins. */
static void
make_sinks (GstRTSPStream *stream, GstRTSPLowerTrans lower)
{
  GstRTSPTransport *transport = make_transport (lower);
  bool has_sockets = false;
  for (GSocketFamily family : {G_SOCKET_FAMILY_IPV4, G_SOCKET_FAMILY_IPV6}) {
    if (!gst_rtsp_stream_allocate_udp_sockets (stream, family, transport, FALSE))
      continue; /* no such addresses here */
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
    g_printerr ("rtsp-server: warning: there are no sockets for %s; who joins by it may stop the "
                "stream\n",
        lower == GST_RTSP_LOWER_TRANS_UDP ? "UDP" : "multicast");
  gst_rtsp_transport_free (transport);
}

/* The library would make what a transport needs when its first viewer joins, in the midst of what
 * runs: of more than two transports it links a queue before it starts it, and a packet that comes
 * in between ends the stream for all viewers, in silence. */
static void
make_all_sinks (GstRTSPMedia *media)
{
  const GstRTSPLowerTrans served = gst_rtsp_media_get_protocols (media);
  for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++)
    for (GstRTSPLowerTrans lower : {GST_RTSP_LOWER_TRANS_UDP, GST_RTSP_LOWER_TRANS_UDP_MCAST})
      if (served & lower)
        make_sinks (gst_rtsp_media_get_stream (media, i), lower);
}

/* A transport that sends nothing to nobody. */
static GstRTSPStreamTransport *
make_dry_transport (GstRTSPStream *stream)
{
  GstRTSPTransport *transport = make_transport (GST_RTSP_LOWER_TRANS_TCP);
  transport->interleaved = {0, 1};
  transport->destination = g_strdup ("nobody"); /* reports are compared with it */
  GstRTSPStreamTransport *dry = gst_rtsp_stream_transport_new (stream, transport);
  const auto swallow = [] (GstBuffer *, guint8, gpointer) -> gboolean { return TRUE; };
  const auto swallow_list = [] (GstBufferList *, guint8, gpointer) -> gboolean { return TRUE; };
  gst_rtsp_stream_transport_set_callbacks (dry, swallow, swallow, nullptr, nullptr);
  gst_rtsp_stream_transport_set_list_callbacks (dry, swallow_list, swallow_list, nullptr, nullptr);
  return dry;
}

static void
deactivate (GPtrArray *transports)
{
  for (guint i = 0; i < transports->len; i++)
    gst_rtsp_stream_transport_set_active (
        GST_RTSP_STREAM_TRANSPORT (g_ptr_array_index (transports, i)), FALSE);
}

bool
MediaHolder::hold (GstRTSPMedia *media)
{
  {
    std::unique_lock guard (lock_);
    /* Who plays before it has its sinks would have them made in the midst. */
    changed_.wait_for (guard, std::chrono::seconds (1),
        [&] { return media_ != media || phase_ != Phase::kTaking; });
    if (media_ || g_object_get_data (G_OBJECT (media), kReleasedKey))
      return media_ == media;
    media_ = GST_RTSP_MEDIA (g_object_ref (media));
    phase_ = Phase::kTaking;
    unwanted_ = false;
  }
  GPtrArray *transports = nullptr;
  if (gst_rtsp_media_prepare (media, nullptr)) {
    transports = g_ptr_array_new_with_free_func (g_object_unref);
    for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++)
      g_ptr_array_add (transports, make_dry_transport (gst_rtsp_media_get_stream (media, i)));
    make_all_sinks (media);
    send_as_they_come (media);
    gst_rtsp_media_complete_pipeline (media, transports);
  }
  std::unique_lock guard (lock_);
  transports_ = transports;
  phase_ = Phase::kHeld;
  changed_.notify_all ();
  if (transports && !unwanted_)
    return true;
  let_go (guard);
  return false;
}

void
MediaHolder::start (GstRTSPMedia *media)
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
  if (media_ != media) /* released meanwhile: nothing may stay behind in its streams */
    deactivate (transports);
  g_ptr_array_unref (transports);
}

bool
MediaHolder::has_started (GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  return media_ == media && phase_ == Phase::kStarted;
}

/* With the lock, which is not held while the media ends. */
void
MediaHolder::let_go (std::unique_lock<std::mutex> &guard)
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
MediaHolder::release (GstRTSPMedia *only)
{
  std::unique_lock guard (lock_);
  if (only)
    g_object_set_data (G_OBJECT (only), kReleasedKey, only);
  if (only && media_ != only)
    return;
  if (phase_ == Phase::kTaking)
    unwanted_ = true; /* who takes it lets it go */
  else
    let_go (guard);
}

void
MediaHolder::release_unless_asked_since (gint64 monotonic_us)
{
  std::unique_lock guard (lock_);
  if (asked_at_us_ < monotonic_us && phase_ != Phase::kTaking)
    let_go (guard);
}

void
MediaHolder::note_asking ()
{
  std::unique_lock guard (lock_);
  asked_at_us_ = g_get_monotonic_time ();
  changed_.wait (guard, [this] { return releasing_ == 0; });
}

bool
MediaHolder::holds_any ()
{
  std::lock_guard guard (lock_);
  return media_ != nullptr;
}
