/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "tcp-viewer.hpp"

#include <gst/rtp/rtp.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "join.hpp"
#include "transports.hpp"

static constexpr std::size_t kMaxFrameSets = 4;
/* Frame sets of many slices may come as one packet each; reports are few. */
static constexpr std::size_t kMaxMessages = 65536;

struct Message {
  GstBuffer *buffer;   /* or */
  GstBufferList *list; /* packets */
  bool is_rtp;
  guint32 timestamp; /* of RTP */
};

/* Locks: `sending`, then `lock`, then a JoinGate's. Nothing but the gate is called while `lock` is
 * held. */
/* Behind the callbacks of transports; shared, since those may run while it is closed. */
class TcpQueue : public std::enable_shared_from_this<TcpQueue> {
public:
  /** @param gate  nullptr: nothing is held back */
  TcpQueue (GstRTSPStreamTransport *transport, GMainContext *context,
      std::atomic<guint64> &left_out, std::shared_ptr<JoinGate> gate);
  ~TcpQueue ();
  void take (const Message &message);
  void send_waiting ();
  void note_sent ();
  void keep_alive ();
  void close ();

private:
  bool is_held_back (const Message &message);
  void leave_out_all ();
  bool pop (Message &message);
  bool hand_over (const Message &message);
  void wake ();

  GWeakRef transport_; /* of the library */
  GMainContext *context_;
  std::atomic<guint64> &left_out_;
  std::mutex sending_;    /* held while a message is handed over */
  const gint64 until_us_; /* monotonic; held back no longer */

  std::mutex lock_;                /* guards all below */
  std::shared_ptr<JoinGate> gate_; /* until a key frame set begins */
  std::deque<Message> waiting_;
  std::size_t frame_sets_ = 0; /* among them */
  bool busy_ = false;          /* a message is on its way */
  bool draining_ = false;      /* in send_waiting() */
  bool woken_ = false;
  bool closed_ = false;
};

using Handle = std::shared_ptr<TcpQueue>;

static void
delete_handle (gpointer handle)
{
  delete static_cast<Handle *> (handle);
}

static TcpQueue &
queue_of (gpointer handle)
{
  return **static_cast<Handle *> (handle);
}

static void
forget (const Message &message)
{
  if (message.buffer)
    gst_buffer_unref (message.buffer);
  if (message.list)
    gst_buffer_list_unref (message.list);
}

static guint32
timestamp_of (GstBuffer *packet)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  guint32 timestamp = 0;
  if (packet && gst_rtp_buffer_map (packet, GST_MAP_READ, &rtp)) {
    timestamp = gst_rtp_buffer_get_timestamp (&rtp);
    gst_rtp_buffer_unmap (&rtp);
  }
  return timestamp;
}

/* ---- what the stream gives, in its own thread ---- */

static gboolean
take_rtp (GstBuffer *packet, guint8, gpointer handle)
{
  queue_of (handle).take ({gst_buffer_ref (packet), nullptr, true, timestamp_of (packet)});
  return TRUE;
}

static gboolean
take_rtcp (GstBuffer *packet, guint8, gpointer handle)
{
  queue_of (handle).take ({gst_buffer_ref (packet), nullptr, false, 0});
  return TRUE;
}

static gboolean
take_rtp_list (GstBufferList *list, guint8, gpointer handle)
{
  if (gst_buffer_list_length (list) > 0)
    queue_of (handle).take (
        {nullptr, gst_buffer_list_ref (list), true, timestamp_of (gst_buffer_list_get (list, 0))});
  return TRUE;
}

static gboolean
take_rtcp_list (GstBufferList *list, guint8, gpointer handle)
{
  if (gst_buffer_list_length (list) > 0)
    queue_of (handle).take ({nullptr, gst_buffer_list_ref (list), false, 0});
  return TRUE;
}

/* ---- the queue ---- */

TcpQueue::TcpQueue (GstRTSPStreamTransport *transport, GMainContext *context,
    std::atomic<guint64> &left_out, std::shared_ptr<JoinGate> gate)
    : context_ (g_main_context_ref (context)), left_out_ (left_out),
      until_us_ (g_get_monotonic_time () + kLongestHold_us), gate_ (std::move (gate))
{
  g_weak_ref_init (&transport_, transport);
}

TcpQueue::~TcpQueue ()
{
  for (const Message &message : waiting_)
    forget (message);
  g_weak_ref_clear (&transport_);
  g_main_context_unref (context_);
}

/* With the lock. */
bool
TcpQueue::is_held_back (const Message &message)
{
  if (!gate_ || !message.is_rtp)
    return false;
  GstBuffer *first = message.list ? gst_buffer_list_get (message.list, 0) : message.buffer;
  if (!gate_->begins_key_frame_set (first) && g_get_monotonic_time () < until_us_)
    return true;
  gate_ = nullptr;
  return false;
}

/* With the lock. */
void
TcpQueue::leave_out_all ()
{
  std::deque<Message> reports;
  for (const Message &message : waiting_)
    if (message.is_rtp)
      forget (message);
    else
      reports.push_back (message);
  waiting_.swap (reports);
  left_out_ += frame_sets_;
  frame_sets_ = 0;
}

void
TcpQueue::take (const Message &message)
{
  std::unique_lock guard (lock_);
  if (closed_ || waiting_.size () >= kMaxMessages || is_held_back (message)) {
    guard.unlock ();
    forget (message);
    return;
  }
  if (message.is_rtp) {
    const Message *last = nullptr;
    for (auto it = waiting_.rbegin (); it != waiting_.rend () && !last; ++it)
      if (it->is_rtp)
        last = &*it;
    if (!last || last->timestamp != message.timestamp) {
      if (frame_sets_ >= kMaxFrameSets)
        leave_out_all ();
      frame_sets_++;
    }
  }
  waiting_.push_back (message);
  guard.unlock ();
  wake ();
}

/* Sends in the thread of the connection, so that it does not end meanwhile. */
void
TcpQueue::wake ()
{
  Handle handle = weak_from_this ().lock ();
  if (!handle)
    return;
  {
    std::lock_guard guard (lock_);
    if (woken_ || draining_ || busy_ || closed_ || waiting_.empty ())
      return;
    woken_ = true;
  }
  GSource *source = g_idle_source_new ();
  g_source_set_priority (source, G_PRIORITY_DEFAULT);
  const auto send = [] (gpointer handle) -> gboolean {
    queue_of (handle).send_waiting ();
    return G_SOURCE_REMOVE;
  };
  g_source_set_callback (source, send, new Handle (std::move (handle)), delete_handle);
  g_source_attach (source, context_);
  g_source_unref (source);
}

/* The next message, if one may be sent now. */
bool
TcpQueue::pop (Message &message)
{
  std::lock_guard guard (lock_);
  woken_ = false;
  draining_ = !busy_ && !closed_ && !waiting_.empty ();
  if (!draining_)
    return false;
  message = waiting_.front ();
  waiting_.pop_front ();
  if (message.is_rtp) {
    const auto is_next = [&] (const Message &other) {
      return other.is_rtp && other.timestamp == message.timestamp;
    };
    const bool has_more = std::any_of (waiting_.begin (), waiting_.end (), is_next);
    frame_sets_ -= !has_more && frame_sets_ > 0;
  }
  busy_ = true; /* until note_sent(), which may come from within */
  return true;
}

bool
TcpQueue::hand_over (const Message &message)
{
  auto transport = static_cast<GstRTSPStreamTransport *> (g_weak_ref_get (&transport_));
  if (!transport)
    return false;
  gboolean sent = FALSE;
  if (message.is_rtp)
    sent = message.list ? gst_rtsp_stream_transport_send_rtp_list (transport, message.list)
                        : gst_rtsp_stream_transport_send_rtp (transport, message.buffer);
  else
    sent = message.list ? gst_rtsp_stream_transport_send_rtcp_list (transport, message.list)
                        : gst_rtsp_stream_transport_send_rtcp (transport, message.buffer);
  g_object_unref (transport);
  return sent;
}

void
TcpQueue::send_waiting ()
{
  Message message;
  std::lock_guard sending (sending_);
  while (pop (message)) {
    if (!hand_over (message))
      note_sent (); /* it never will be: the connection is closing */
    forget (message);
  }
}

void
TcpQueue::note_sent ()
{
  {
    std::lock_guard guard (lock_);
    busy_ = false;
  }
  wake ();
}

void
TcpQueue::close ()
{
  std::lock_guard sending (sending_); /* what is being sent ends before */
  std::lock_guard guard (lock_);
  closed_ = true;
  for (const Message &message : waiting_)
    forget (message);
  waiting_.clear ();
}

/* The viewer reported; its session lives on. */
void
TcpQueue::keep_alive ()
{
  auto transport = static_cast<GstRTSPStreamTransport *> (g_weak_ref_get (&transport_));
  if (!transport)
    return;
  gst_rtsp_stream_transport_keep_alive (transport);
  g_object_unref (transport);
}

/* ---- transports ---- */

class Taps;

/* What a transport of the library has of ours. */
struct Tap {
  Handle queue;
  GstRTSPStream *stream;
  GstRTSPStreamTransport *ours;
  std::shared_ptr<Taps> taps; /* of the media */
};

/* Those of one media. A stream that still has a transport cannot leave the pipeline (the library
 * says so and goes on: the elements are freed while they run), and a closed connection frees its
 * transports when its thread comes to it. So they leave the stream when the media ends. */
class Taps {
public:
  /* False if the media is ending. */
  bool add (Tap *tap)
  {
    std::lock_guard guard (lock_);
    if (ended_)
      return false;
    gst_rtsp_stream_add_transport (tap->stream, tap->ours);
    taps_.push_back (tap);
    return true;
  }
  void remove (Tap *tap)
  {
    std::lock_guard guard (lock_);
    if (std::erase (taps_, tap) > 0)
      gst_rtsp_stream_remove_transport (tap->stream, tap->ours);
  }
  void end ()
  {
    std::lock_guard guard (lock_);
    ended_ = true;
    for (Tap *tap : taps_)
      gst_rtsp_stream_remove_transport (tap->stream, tap->ours);
    taps_.clear ();
  }
  std::vector<Handle> queues ()
  {
    std::lock_guard guard (lock_);
    std::vector<Handle> queues;
    for (const Tap *tap : taps_)
      queues.push_back (tap->queue);
    return queues;
  }

private:
  std::mutex lock_; /* taken before that of a stream */
  bool ended_ = false;
  std::vector<Tap *> taps_; /* in their streams */
};

using TapsHandle = std::shared_ptr<Taps>;

static const char kTapKey[] = "rangecast-tcp-queue";   /* of a transport: its Tap */
static const char kTapsKey[] = "rangecast-tcp-queues"; /* of a media: a TapsHandle */

/* Maybe in hand_over(), which drops the last reference: so it does not close the queue. */
static void
delete_tap (gpointer user_data)
{
  auto tap = static_cast<Tap *> (user_data);
  tap->taps->remove (tap);
  g_object_unref (tap->ours);
  g_object_unref (tap->stream);
  delete tap;
}

/* ---- reports of the stream ---- */

/* RFC 3550, 6.1; RFC 5761, 4: by its type. */
static bool
is_report (GstBuffer *packet)
{
  guint8 header[2];
  return gst_buffer_extract (packet, 0, header, sizeof header) == sizeof header &&
         header[0] >> 6 == 2 && header[1] >= 192 && header[1] <= 223;
}

/* Frame sets and reports each come to an appsink, which holds one. The library's one thread (1.22)
 * that takes them from there sends a report first, where there are both, and then sleeps until the
 * next comes: but no frame set comes while one waits, and the stream stands still for all viewers.
 * So reports go to the queues from here. */
static GstPadProbeReturn
on_report (GstPad *, GstPadProbeInfo *info, gpointer taps)
{
  GstBuffer *packet = GST_PAD_PROBE_INFO_BUFFER (info);
  if (!is_report (packet))
    return GST_PAD_PROBE_OK;
  for (const Handle &queue : (*static_cast<TapsHandle *> (taps))->queues ())
    queue->take ({gst_buffer_ref (packet), nullptr, false, 0});
  return GST_PAD_PROBE_DROP;
}

static void
delete_taps (gpointer taps)
{
  delete static_cast<TapsHandle *> (taps);
}

static void
on_element (GstBin *, GstElement *element, gpointer taps)
{
  GstElementFactory *factory = gst_element_get_factory (element);
  if (!factory || !g_str_equal (GST_OBJECT_NAME (factory), "appsink"))
    return;
  GstPad *pad = gst_element_get_static_pad (element, "sink");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, on_report,
      new TapsHandle (*static_cast<TapsHandle *> (taps)), delete_taps);
  gst_object_unref (pad);
}

/* Comes before the streams leave the pipeline. */
static void
on_target_state (GstRTSPMedia *media, GstState state, gpointer)
{
  if (state == GST_STATE_NULL)
    (*static_cast<TapsHandle *> (g_object_get_data (G_OBJECT (media), kTapsKey)))->end ();
}

void
prepare_tcp_queues (GstRTSPMedia *media)
{
  auto taps = new TapsHandle (std::make_shared<Taps> ());
  g_object_set_data_full (G_OBJECT (media), kTapsKey, taps, delete_taps);
  GstElement *bin = gst_rtsp_media_get_element (media);
  GstObject *pipeline = gst_object_get_parent (GST_OBJECT (bin));
  if (pipeline && gst_rtsp_media_n_streams (media) == 1) /* of several each has its own viewers */
    g_signal_connect_data (
        pipeline, "element-added", G_CALLBACK (on_element), new TapsHandle (*taps),
        [] (gpointer own, GClosure *) { delete_taps (own); }, GConnectFlags (0));
  gst_clear_object (&pipeline);
  gst_object_unref (bin);
  g_signal_connect (media, "target-state", G_CALLBACK (on_target_state), nullptr);
}

static const char kHandleKey[] = "rangecast-tcp-queue-handle"; /* of ours */

/* A transport of ours in its place. The stream finds it by the address, too, when reports come. */
static GstRTSPStreamTransport *
make_transport (GstRTSPStreamTransport *transport, const Handle &queue)
{
  const GstRTSPTransport *to = gst_rtsp_stream_transport_get_transport (transport);
  GstRTSPTransport *copy = nullptr;
  gst_rtsp_transport_new (&copy);
  copy->trans = to->trans;
  copy->profile = to->profile;
  copy->lower_transport = to->lower_transport;
  copy->destination = g_strdup (to->destination);
  copy->source = g_strdup (to->source);
  copy->interleaved = to->interleaved;
  copy->client_port = to->client_port;
  copy->server_port = to->server_port;
  copy->ssrc = to->ssrc;
  GstRTSPStreamTransport *ours =
      gst_rtsp_stream_transport_new (gst_rtsp_stream_transport_get_stream (transport), copy);
  gst_rtsp_stream_transport_set_callbacks (
      ours, take_rtp, take_rtcp, new Handle (queue), delete_handle);
  /* The library (1.22) frees what belongs to the other callbacks, but never what belongs to these.
   */
  auto handle = new Handle (queue);
  g_object_set_data_full (G_OBJECT (ours), kHandleKey, handle, delete_handle);
  gst_rtsp_stream_transport_set_list_callbacks (
      ours, take_rtp_list, take_rtcp_list, handle, nullptr);
  gst_rtsp_stream_transport_set_keepalive (
      ours, [] (gpointer handle) { queue_of (handle).keep_alive (); }, new Handle (queue),
      delete_handle);
  return ours;
}

static void
tap_transport (GstRTSPStreamTransport *transport, GstRTSPMedia *media, GMainContext *context,
    std::atomic<guint64> &left_out, const std::shared_ptr<JoinGate> &gate)
{
  GstRTSPStream *stream = gst_rtsp_stream_transport_get_stream (transport);
  auto taps = static_cast<TapsHandle *> (g_object_get_data (G_OBJECT (media), kTapsKey));
  auto queue = std::make_shared<TcpQueue> (transport, context, left_out, gate);
  auto tap = new Tap{
      queue, GST_RTSP_STREAM (g_object_ref (stream)), make_transport (transport, queue), *taps};
  gst_rtsp_stream_remove_transport (stream, transport);
  if (!(*taps)->add (tap)) {
    delete_tap (tap);
    return;
  }
  gst_rtsp_stream_transport_set_message_sent (
      transport, [] (gpointer handle) { queue_of (handle).note_sent (); }, new Handle (queue),
      delete_handle);
  g_object_set_data_full (G_OBJECT (transport), kTapKey, tap, delete_tap);
}

void
queue_tcp_transports (GstRTSPSessionMedia *media, std::atomic<guint64> &left_out, bool holds_back)
{
  GSource *source = g_main_current_source ();
  if (!source)
    return;
  GstRTSPMedia *whole = gst_rtsp_session_media_get_media (media);
  for (const TransportRef &ref : transports_of (media, GST_RTSP_LOWER_TRANS_TCP)) {
    GstRTSPStreamTransport *transport = ref.get ();
    if (!g_object_get_data (G_OBJECT (transport), kTapKey))
      tap_transport (transport, whole, g_source_get_context (source), left_out,
          holds_back ? JoinGate::of (whole) : nullptr);
    else /* each PLAY puts it in again */
      gst_rtsp_stream_remove_transport (
          gst_rtsp_stream_transport_get_stream (transport), transport);
  }
}

bool
has_tcp_queues (GstRTSPSessionMedia *media)
{
  const auto has = [] (const TransportRef &ref) {
    return g_object_get_data (G_OBJECT (ref.get ()), kTapKey) != nullptr;
  };
  return std::ranges::any_of (transports_of (media, GST_RTSP_LOWER_TRANS_TCP), has);
}

static GstRTSPFilterResult
drop_media (GstRTSPSession *, GstRTSPSessionMedia *media, gpointer)
{
  for (const TransportRef &ref : transports_of (media, GST_RTSP_LOWER_TRANS_TCP)) {
    GstRTSPStreamTransport *transport = ref.get ();
    if (auto tap = static_cast<Tap *> (g_object_get_data (G_OBJECT (transport), kTapKey)))
      tap->queue->close ();
    g_object_set_data (G_OBJECT (transport), kTapKey, nullptr);
  }
  return GST_RTSP_FILTER_KEEP;
}

void
drop_tcp_transports (GstRTSPSession *session)
{
  g_list_free_full (gst_rtsp_session_filter (session, drop_media, nullptr), g_object_unref);
}
