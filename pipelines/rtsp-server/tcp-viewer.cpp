/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "tcp-viewer.hpp"

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "glue.hpp"
#include "join.hpp"

namespace {

constexpr std::size_t kMaxFrameSets = 4;
/* Frame sets of many slices may come as one packet each; reports are few. */
constexpr std::size_t kMaxMessages = 65536;

struct MiniObjectUnref {
  void operator() (GstMiniObject *object) const { gst_mini_object_unref (object); }
};

struct Message {
  std::unique_ptr<GstMiniObject, MiniObjectUnref> packets; /* GstBuffer or GstBufferList */
  std::optional<RtpStart> rtp;                             /* of the first packet; RTCP has none */

  [[nodiscard]] GstBuffer *first_packet () const
  {
    return GST_IS_BUFFER_LIST (packets.get ())
               ? gst_buffer_list_get (GST_BUFFER_LIST (packets.get ()), 0)
               : GST_BUFFER (packets.get ());
  }
};

/* The packets that wait for one TCP viewer. Shared with the callbacks of transports, which may run
 * while it is closed. Locks: `sending_`, then `lock_`, then that of a JoinGate, which is all that
 * is called with `lock_`. */
class TcpQueue : public std::enable_shared_from_this<TcpQueue> {
public:
  /** @param gate  nullptr: nothing is held back */
  TcpQueue (GstRTSPStreamTransport *transport, GMainContext *context,
      std::atomic<guint64> &left_out, std::shared_ptr<JoinGate> gate);
  ~TcpQueue ();
  /** @param packets  a GstBuffer or GstBufferList of packets */
  void push (GstMiniObject *packets);
  void send_waiting ();
  void handle_sent ();
  void keep_alive ();
  void close ();

private:
  bool is_before_key (const Message &message);
  void drop_frame_sets ();
  bool pop (Message &message);
  bool hand_over (const Message &message);
  void wake ();

  GWeakRef transport_; /* of gst-rtsp-server */
  GMainContext *context_;
  std::atomic<guint64> &left_out_;
  std::mutex sending_;    /* held while a message is handed over */
  const gint64 until_us_; /* monotonic; when it stops waiting for a key frame set */

  std::mutex lock_;                /* guards all below */
  std::shared_ptr<JoinGate> gate_; /* until a key frame set begins */
  std::deque<Message> waiting_;
  std::size_t frame_sets_ = 0; /* among them */
  bool busy_ = false;          /* a message is being sent */
  bool draining_ = false;      /* in send_waiting() */
  bool woken_ = false;         /* send_waiting() is scheduled */
  bool closed_ = false;
};

using Handle = std::shared_ptr<TcpQueue>;

TcpQueue &
queue_of (gpointer handle)
{
  return **static_cast<Handle *> (handle);
}

/* Callback of our transport, for RTP and RTCP; streaming thread. */
template <typename Packets>
gboolean
on_packets (Packets *packets, guint8, gpointer handle)
{
  queue_of (handle).push (GST_MINI_OBJECT (packets));
  return TRUE;
}

/* ---- the queue ---- */

TcpQueue::TcpQueue (GstRTSPStreamTransport *transport, GMainContext *context,
    std::atomic<guint64> &left_out, std::shared_ptr<JoinGate> gate)
    : context_ (g_main_context_ref (context)), left_out_ (left_out),
      until_us_ (g_get_monotonic_time () + kMaxHold_us), gate_ (std::move (gate))
{
  g_weak_ref_init (&transport_, transport);
}

TcpQueue::~TcpQueue ()
{
  g_weak_ref_clear (&transport_);
  g_main_context_unref (context_);
}

/* With the lock. */
bool
TcpQueue::is_before_key (const Message &message)
{
  if (!gate_ || !message.rtp)
    return false;
  if (!gate_->begins_key_frame_set (*message.rtp) && g_get_monotonic_time () < until_us_)
    return true;
  gate_ = nullptr;
  return false;
}

/* With the lock. */
void
TcpQueue::drop_frame_sets ()
{
  std::erase_if (waiting_, [] (const Message &message) { return message.rtp.has_value (); });
  left_out_ += frame_sets_;
  frame_sets_ = 0;
}

void
TcpQueue::push (GstMiniObject *packets)
{
  Message message{{gst_mini_object_ref (packets), {}}, {}};
  if (GST_IS_BUFFER_LIST (packets) && gst_buffer_list_length (GST_BUFFER_LIST (packets)) == 0)
    return;
  message.rtp = read_rtp_start (message.first_packet ());
  std::unique_lock guard (lock_);
  if (closed_ || waiting_.size () >= kMaxMessages || is_before_key (message))
    return;
  if (message.rtp) {
    const auto last = std::find_if (waiting_.rbegin (), waiting_.rend (),
        [] (const Message &other) { return other.rtp.has_value (); });
    if (last == waiting_.rend () || last->rtp->timestamp != message.rtp->timestamp) {
      if (frame_sets_ >= kMaxFrameSets)
        drop_frame_sets ();
      frame_sets_++;
    }
  }
  waiting_.push_back (std::move (message));
  guard.unlock ();
  wake ();
}

/* Schedules send_waiting() in the thread that serves the connection, which must not end during it.
 */
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
  g_source_set_callback (source, send, new Handle (std::move (handle)), delete_data<Handle>);
  g_source_attach (source, context_);
  g_source_unref (source);
}

/* @return false if nothing waits, or a message is being sent */
bool
TcpQueue::pop (Message &message)
{
  std::lock_guard guard (lock_);
  woken_ = false;
  draining_ = !busy_ && !closed_ && !waiting_.empty ();
  if (!draining_)
    return false;
  message = std::move (waiting_.front ());
  waiting_.pop_front ();
  if (message.rtp) {
    const bool has_more = std::ranges::any_of (waiting_, [&] (const Message &other) {
      return other.rtp && other.rtp->timestamp == message.rtp->timestamp;
    });
    frame_sets_ -= !has_more && frame_sets_ > 0;
  }
  busy_ = true; /* until handle_sent(), maybe within hand_over() */
  return true;
}

bool
TcpQueue::hand_over (const Message &message)
{
  auto transport = static_cast<GstRTSPStreamTransport *> (g_weak_ref_get (&transport_));
  if (!transport)
    return false;
  GstMiniObject *packets = message.packets.get ();
  gboolean sent = FALSE;
  if (GST_IS_BUFFER_LIST (packets))
    sent = (message.rtp
                ? gst_rtsp_stream_transport_send_rtp_list
                : gst_rtsp_stream_transport_send_rtcp_list) (transport, GST_BUFFER_LIST (packets));
  else
    sent = (message.rtp ? gst_rtsp_stream_transport_send_rtp
                        : gst_rtsp_stream_transport_send_rtcp) (transport, GST_BUFFER (packets));
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
      handle_sent (); /* the connection is closing: there is no callback */
  }
}

void
TcpQueue::handle_sent ()
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
  std::lock_guard sending (sending_); /* after what is being sent */
  std::lock_guard guard (lock_);
  closed_ = true;
  waiting_.clear ();
}

/* The viewer sent RTCP. */
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

class MediaQueues;

/* The replacement of one transport. */
struct Replacement {
  Handle queue;
  GstRTSPStream *stream;
  GstRTSPStreamTransport *ours;
  std::shared_ptr<MediaQueues> queues; /* of the media */
};

/* The replacements of one media. When a media ends, gst-rtsp-server 1.22 warns of a stream that
 * still has transports and frees its elements while they run; and a closed connection frees its
 * transports when its thread gets to it. So all are removed from their streams when the media ends.
 */
class MediaQueues {
public:
  /* False if the media is ending. */
  bool add (Replacement *replacement)
  {
    std::lock_guard guard (lock_);
    if (ended_)
      return false;
    gst_rtsp_stream_add_transport (replacement->stream, replacement->ours);
    replacements_.push_back (replacement);
    return true;
  }
  void remove (Replacement *replacement)
  {
    std::lock_guard guard (lock_);
    if (std::erase (replacements_, replacement) > 0)
      gst_rtsp_stream_remove_transport (replacement->stream, replacement->ours);
  }
  void end ()
  {
    std::lock_guard guard (lock_);
    ended_ = true;
    for (Replacement *replacement : replacements_)
      gst_rtsp_stream_remove_transport (replacement->stream, replacement->ours);
    replacements_.clear ();
  }
  std::vector<Handle> queues ()
  {
    std::lock_guard guard (lock_);
    std::vector<Handle> queues;
    for (const Replacement *replacement : replacements_)
      queues.push_back (replacement->queue);
    return queues;
  }

private:
  std::mutex lock_; /* taken before that of a stream */
  bool ended_ = false;
  std::vector<Replacement *> replacements_; /* in their streams */
};

using QueuesHandle = std::shared_ptr<MediaQueues>;

const char kReplacementKey[] = "rangecast-tcp-queue"; /* of a transport: its Replacement */
const char kQueuesKey[] = "rangecast-tcp-queues";     /* object data of a media: a QueuesHandle */

/* Does not close the queue, since hand_over() may drop the last reference. */
void
delete_replacement (gpointer user_data)
{
  auto replacement = static_cast<Replacement *> (user_data);
  replacement->queues->remove (replacement);
  g_object_unref (replacement->ours);
  g_object_unref (replacement->stream);
  delete replacement;
}

/* ---- RTCP of the stream ---- */

/* gst-rtsp-server 1.22 has an appsink of one buffer each for RTP and for RTCP, and one thread that
 * sends from both. Where both have a buffer, the thread sends RTCP and then sleeps until the next
 * buffer comes; but RTP cannot come while its appsink is full, so the stream stops for all TCP
 * viewers. Therefore RTCP goes to the queues from here and never gets to its appsink. */
GstPadProbeReturn
on_appsink_buffer (GstPad *, GstPadProbeInfo *info, gpointer queues)
{
  GstBuffer *packet = GST_PAD_PROBE_INFO_BUFFER (info);
  if (read_rtp_start (packet))
    return GST_PAD_PROBE_OK;
  for (const Handle &queue : (*static_cast<QueuesHandle *> (queues))->queues ())
    queue->push (GST_MINI_OBJECT (packet));
  return GST_PAD_PROBE_DROP;
}

void
on_element (GstBin *, GstElement *element, gpointer queues)
{
  GstElementFactory *factory = gst_element_get_factory (element);
  if (!factory || !g_str_equal (GST_OBJECT_NAME (factory), "appsink"))
    return;
  GstPad *pad = gst_element_get_static_pad (element, "sink");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, on_appsink_buffer,
      new QueuesHandle (*static_cast<QueuesHandle *> (queues)), delete_data<QueuesHandle>);
  gst_object_unref (pad);
}

/* Before the streams leave the pipeline. */
void
on_target_state (GstRTSPMedia *media, GstState state, gpointer)
{
  if (state == GST_STATE_NULL)
    (*static_cast<QueuesHandle *> (g_object_get_data (G_OBJECT (media), kQueuesKey)))->end ();
}

} // namespace

void
prepare_tcp_queues (GstRTSPMedia *media)
{
  auto queues = new QueuesHandle (std::make_shared<MediaQueues> ());
  g_object_set_data_full (G_OBJECT (media), kQueuesKey, queues, delete_data<QueuesHandle>);
  GstElement *pipeline = pipeline_of (media);
  if (pipeline &&
      gst_rtsp_media_n_streams (media) == 1) /* of several streams, each has its own viewers */
    g_signal_connect_data (pipeline, "element-added", G_CALLBACK (on_element),
        new QueuesHandle (*queues), delete_closure_data<QueuesHandle>, GConnectFlags (0));
  gst_clear_object (&pipeline);
  g_signal_connect (media, "target-state", G_CALLBACK (on_target_state), nullptr);
}

namespace {

const char kHandleKey[] = "rangecast-tcp-queue-handle"; /* object data of our transport */

/* The transport that gets the packets instead, with the same address, by which the stream
 * attributes RTCP. */
GstRTSPStreamTransport *
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
      ours, on_packets<GstBuffer>, on_packets<GstBuffer>, new Handle (queue), delete_data<Handle>);
  /* gst-rtsp-server 1.22 never calls the destroy notify of list callbacks, hence the object data.
   */
  auto handle = new Handle (queue);
  g_object_set_data_full (G_OBJECT (ours), kHandleKey, handle, delete_data<Handle>);
  gst_rtsp_stream_transport_set_list_callbacks (
      ours, on_packets<GstBufferList>, on_packets<GstBufferList>, handle, nullptr);
  gst_rtsp_stream_transport_set_keepalive (
      ours, [] (gpointer handle) { queue_of (handle).keep_alive (); }, new Handle (queue),
      delete_data<Handle>);
  return ours;
}

void
replace_transport (GstRTSPStreamTransport *transport, GstRTSPMedia *media, GMainContext *context,
    std::atomic<guint64> &left_out, const std::shared_ptr<JoinGate> &gate)
{
  GstRTSPStream *stream = gst_rtsp_stream_transport_get_stream (transport);
  auto queues = static_cast<QueuesHandle *> (g_object_get_data (G_OBJECT (media), kQueuesKey));
  auto queue = std::make_shared<TcpQueue> (transport, context, left_out, gate);
  auto replacement = new Replacement{
      queue, GST_RTSP_STREAM (g_object_ref (stream)), make_transport (transport, queue), *queues};
  gst_rtsp_stream_remove_transport (stream, transport);
  if (!(*queues)->add (replacement)) {
    delete_replacement (replacement);
    return;
  }
  gst_rtsp_stream_transport_set_message_sent (
      transport, [] (gpointer handle) { queue_of (handle).handle_sent (); }, new Handle (queue),
      delete_data<Handle>);
  g_object_set_data_full (G_OBJECT (transport), kReplacementKey, replacement, delete_replacement);
}

} // namespace

void
queue_tcp_transports (GstRTSPSessionMedia *media, std::atomic<guint64> &left_out, bool holds_back)
{
  GSource *source = g_main_current_source ();
  if (!source)
    return;
  GstRTSPMedia *whole = gst_rtsp_session_media_get_media (media);
  for (const TransportRef &ref : transports_of (media, GST_RTSP_LOWER_TRANS_TCP)) {
    GstRTSPStreamTransport *transport = ref.get ();
    if (!g_object_get_data (G_OBJECT (transport), kReplacementKey))
      replace_transport (transport, whole, g_source_get_context (source), left_out,
          holds_back ? JoinGate::of (whole) : nullptr);
    else /* which PLAY has added again */
      gst_rtsp_stream_remove_transport (
          gst_rtsp_stream_transport_get_stream (transport), transport);
  }
}

bool
has_tcp_queues (GstRTSPSessionMedia *media)
{
  const auto has = [] (const TransportRef &ref) {
    return g_object_get_data (G_OBJECT (ref.get ()), kReplacementKey) != nullptr;
  };
  return std::ranges::any_of (transports_of (media, GST_RTSP_LOWER_TRANS_TCP), has);
}

namespace {

GstRTSPFilterResult
drop_media (GstRTSPSession *, GstRTSPSessionMedia *media, gpointer)
{
  for (const TransportRef &ref : transports_of (media, GST_RTSP_LOWER_TRANS_TCP)) {
    GstRTSPStreamTransport *transport = ref.get ();
    if (auto replacement =
            static_cast<Replacement *> (g_object_get_data (G_OBJECT (transport), kReplacementKey)))
      replacement->queue->close ();
    g_object_set_data (G_OBJECT (transport), kReplacementKey, nullptr);
  }
  return GST_RTSP_FILTER_KEEP;
}

} // namespace

void
drop_tcp_transports (GstRTSPSession *session)
{
  g_list_free_full (gst_rtsp_session_filter (session, drop_media, nullptr), g_object_unref);
}
