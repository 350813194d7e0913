/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "join.hpp"

#include <algorithm>
#include <chrono>

#include "glue.hpp"

namespace {

const char kGateKey[] = "rangecast-join-gate";
constexpr gsize kRtpHeader = 12; /* bytes */

using Gate = std::shared_ptr<JoinGate>;

JoinGate &
gate_of (gpointer gate)
{
  return **static_cast<Gate *> (gate);
}

bool
has_tcp_viewer (GstRTSPSessionMedia *media)
{
  return !transports_of (media, GST_RTSP_LOWER_TRANS_TCP).empty ();
}

GstBuffer *
first_buffer (GstPadProbeInfo *info)
{
  if (GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER)
    return GST_PAD_PROBE_INFO_BUFFER (info);
  GstBufferList *list = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
  return gst_buffer_list_length (list) > 0 ? gst_buffer_list_get (list, 0) : nullptr;
}

void
watch_pad (GstElement *element, const char *name, GstPadProbeCallback callback, const Gate &gate)
{
  GstPad *pad = gst_element_get_static_pad (element, name);
  if (!pad)
    return;
  gst_pad_add_probe (pad,
      GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST), callback,
      new Gate (gate), delete_data<Gate>);
  gst_object_unref (pad);
}

/* ---- while a TCP viewer gets its queue ---- */

constexpr gint64 kMaxPause_us = 50000;
constexpr gint64 kMinPauseInterval_us = 100000;
constexpr gulong kInFlight_us = 5000; /* from the payloader to the transports */

} // namespace

void
ShortPause::begin ()
{
  {
    std::lock_guard guard (lock_);
    const gint64 now = g_get_monotonic_time ();
    if (now < since_us_ + kMinPauseInterval_us)
      return;
    since_us_ = now;
    n_ = now < until_us_ ? n_ + 1 : 1;
    until_us_ = now + kMaxPause_us;
  }
  g_usleep (kInFlight_us);
}

void
ShortPause::end ()
{
  std::lock_guard guard (lock_);
  n_ = std::max (n_ - 1, 0);
  changed_.notify_all ();
}

void
ShortPause::wait ()
{
  std::unique_lock guard (lock_);
  const gint64 until_us = g_get_monotonic_time () + kMaxPause_us;
  while (n_ > 0) {
    const gint64 left_us = std::min (until_us, until_us_) - g_get_monotonic_time ();
    if (left_us <= 0)
      return;
    changed_.wait_for (guard, std::chrono::microseconds (left_us));
  }
}

/* ---- which packets begin a key frame set ---- */

std::optional<RtpStart>
read_rtp_start (GstBuffer *packet)
{
  guint8 header[kRtpHeader];
  if (!packet || gst_buffer_extract (packet, 0, header, sizeof header) != sizeof header)
    return std::nullopt;
  if (header[0] >> 6 != 2 || (header[1] >= 192 && header[1] <= 223))
    return std::nullopt;
  return RtpStart{GST_READ_UINT32_BE (header + 4), GST_READ_UINT16_BE (header + 2)};
}

GstPadProbeReturn
JoinGate::on_frame_set (GstPad *, GstPadProbeInfo *info, gpointer gate)
{
  if (GstBuffer *buffer = first_buffer (info))
    gate_of (gate).is_key_ = !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn
JoinGate::on_payload (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  JoinGate &gate = gate_of (user_data);
  const auto start = read_rtp_start (first_buffer (info));
  if (!start)
    return GST_PAD_PROBE_OK;
  const bool begins = !gate.has_last_ || start->timestamp != gate.last_timestamp_;
  gate.has_last_ = true;
  gate.last_timestamp_ = start->timestamp;
  if (begins)
    gate.pause_.wait ();
  if (begins && gate.is_key_) {
    std::lock_guard guard (gate.lock_);
    gate.starts_[gate.n_starts_++ % gate.starts_.size ()] = *start;
  }
  return GST_PAD_PROBE_OK;
}

bool
JoinGate::begins_key_frame_set (const RtpStart &packet)
{
  std::lock_guard guard (lock_);
  const auto end = starts_.begin () + gint (std::min (n_starts_, starts_.size ()));
  return std::find (starts_.begin (), end, packet) != end;
}

/* ---- viewers by UDP ---- */

/* Adds the viewers that wait at this sink, if a key frame set begins or they waited too long. */
void
JoinGate::add_waiting (GstElement *sink, bool is_key)
{
  const gint64 now = g_get_monotonic_time ();
  std::vector<Joiner> ready;
  {
    std::lock_guard guard (lock_);
    std::erase_if (joiners_, [&] (const Joiner &joiner) { /* whose PLAY failed */
      return !joiner.parked && now >= joiner.until_us;
    });
    const auto waits = [&] (const Joiner &joiner) {
      return joiner.parked != sink || (!is_key && now < joiner.until_us);
    };
    const auto first = std::stable_partition (joiners_.begin (), joiners_.end (), waits);
    ready.assign (first, joiners_.end ());
    entering_.insert (entering_.end (), first, joiners_.end ());
    joiners_.erase (first, joiners_.end ());
    waiting_ = int (joiners_.size ());
  }
  for (const Joiner &joiner : ready) {
    gpointer transport = g_weak_ref_get (joiner.transport.get ());
    if (transport)
      g_signal_emit_by_name (sink, "add", joiner.host.c_str (), joiner.port);
    if (has_left (joiner) && transport) /* meanwhile, when there was no client to remove */
      g_signal_emit_by_name (sink, "remove", joiner.host.c_str (), joiner.port);
    g_clear_object (&transport);
  }
}

/* Of a joiner in entering_, which has been added; removes it from there. */
bool
JoinGate::has_left (const Joiner &entered)
{
  std::lock_guard guard (lock_);
  const auto found = std::ranges::find (entering_, entered.transport, &Joiner::transport);
  if (found == entering_.end ())
    return false;
  const bool left = found->left;
  entering_.erase (found);
  return left;
}

GstPadProbeReturn
JoinGate::before_sending (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  JoinGate &gate = gate_of (user_data);
  if (gate.waiting_ > 0) {
    GstElement *sink = gst_pad_get_parent_element (pad);
    const auto start = read_rtp_start (first_buffer (info));
    if (sink)
      gate.add_waiting (sink, start && gate.begins_key_frame_set (*start));
    gst_clear_object (&sink);
  }
  return GST_PAD_PROBE_OK;
}

/* "client-added", in the thread that adds the client. */
void
JoinGate::on_client (GstElement *sink, gchar *host, gint port, gpointer user_data)
{
  JoinGate &gate = gate_of (user_data);
  bool waits = false;
  {
    std::lock_guard guard (gate.lock_);
    for (Joiner &joiner : gate.joiners_)
      if (!joiner.parked && joiner.port == port && joiner.host == host) {
        joiner.parked = sink;
        waits = true;
      }
  }
  if (waits)
    g_signal_emit_by_name (sink, "remove", host, port);
}

void
JoinGate::on_element (GstBin *, GstElement *element, gpointer user_data)
{
  GstElementFactory *factory = gst_element_get_factory (element);
  if (!factory || !g_str_equal (GST_OBJECT_NAME (factory), "multiudpsink"))
    return;
  const Gate &gate = *static_cast<Gate *> (user_data);
  g_signal_connect_data (element, "client-added", G_CALLBACK (on_client), new Gate (gate),
      delete_closure_data<Gate>, GConnectFlags (0));
  watch_pad (element, "sink", before_sending, gate);
}

/* ---- requests ---- */

/* Calls `use` with the lock for the address of each UDP transport. */
void
JoinGate::for_each_address (GstRTSPSessionMedia *media, const UseAddress &use)
{
  for (const TransportRef &transport : transports_of (media, GST_RTSP_LOWER_TRANS_UDP)) {
    const GstRTSPTransport *to = gst_rtsp_stream_transport_get_transport (transport.get ());
    if (!to->destination)
      continue;
    std::lock_guard guard (lock_);
    use (*to, transport.get ());
    waiting_ = int (joiners_.size ());
  }
}

void
JoinGate::hold_back (GstRTSPSessionMedia *media, bool pauses)
{
  for_each_address (media, [this] (const GstRTSPTransport &to, GstRTSPStreamTransport *transport) {
    const std::shared_ptr<GWeakRef> weak (new GWeakRef, [] (GWeakRef *ref) {
      g_weak_ref_clear (ref);
      delete ref;
    });
    g_weak_ref_init (weak.get (), transport);
    const gint64 now = g_get_monotonic_time ();
    std::erase_if (joiners_, [&] (const Joiner &joiner) { /* whose PLAY failed */
      return !joiner.parked && (now >= joiner.until_us || joiner.is_to (to));
    });
    joiners_.push_back ({weak, to.destination, to.client_port.min, now + kMaxHold_us});
  });
  if (pauses && has_tcp_viewer (media))
    pause_.begin ();
}

void
JoinGate::handle_playing (GstRTSPSessionMedia *media)
{
  for_each_address (media, [this] (const GstRTSPTransport &to, GstRTSPStreamTransport *) {
    std::erase_if (
        joiners_, [&] (const Joiner &joiner) { return !joiner.parked && joiner.is_to (to); });
  });
  if (has_tcp_viewer (media))
    pause_.end ();
}

void
JoinGate::remove (GstRTSPSessionMedia *media)
{
  for_each_address (media, [this] (const GstRTSPTransport &to, GstRTSPStreamTransport *) {
    std::erase_if (joiners_, [&] (const Joiner &joiner) { return joiner.is_to (to); });
    for (Joiner &joiner : entering_)
      joiner.left = joiner.left || joiner.is_to (to);
  });
}

void
JoinGate::install (GstRTSPMedia *media, GstElement *pipeline, GstElement *payloader)
{
  const auto gate = std::make_shared<JoinGate> ();
  watch_pad (payloader, "sink", on_frame_set, gate);
  watch_pad (payloader, "src", on_payload, gate);
  g_signal_connect_data (pipeline, "element-added", G_CALLBACK (on_element), new Gate (gate),
      delete_closure_data<Gate>, GConnectFlags (0));
  g_object_set_data_full (G_OBJECT (media), kGateKey, new Gate (gate), delete_data<Gate>);
}

std::shared_ptr<JoinGate>
JoinGate::of (GstRTSPMedia *media)
{
  auto gate = static_cast<Gate *> (g_object_get_data (G_OBJECT (media), kGateKey));
  return gate ? *gate : nullptr;
}
