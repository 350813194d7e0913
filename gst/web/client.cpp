/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "client.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

#include "category.hpp"

namespace web {

namespace {

/** Without an acknowledgement for so long a client is gone, microseconds. */
constexpr gint64 kMaxSilence_us = 60 * G_USEC_PER_SEC;
/** A data channel's frame set that was not acknowledged for so long is lost. */
constexpr gint64 kMaxFlight_us = 2 * G_USEC_PER_SEC;
/** Bytes that may wait for a data channel when the next frame set comes. */
constexpr guint64 kMaxBuffered = 65536;
/** Interval of rig views on a data channel. */
constexpr gint64 kRigInterval_us = G_USEC_PER_SEC / 2;
/** Speech waits for a client whose frame sets have not been acknowledged for so long. */
constexpr gint64 kMaxSpeechWait_us = G_USEC_PER_SEC;
constexpr gint64 kMaxOpening_us = 20 * G_USEC_PER_SEC;
/** Data channels that a client may ask for, and candidates of each. */
constexpr guint kMaxChannels = 4, kMaxCandidates = 64;

} // namespace

Client::Client (GstObject *log, Host &host, const Settings &settings,
    SoupWebsocketConnection *socket, WebLimitedInput *input, std::string address)
    : log_ (log), host_ (host), settings_ (settings),
      socket_ (SOUP_WEBSOCKET_CONNECTION (g_object_ref (socket))),
      input_ (WEB_LIMITED_INPUT (g_object_ref (input))), address_ (std::move (address)),
      label_ (address_), opened_us_ (g_get_monotonic_time ())
{
  soup_websocket_connection_set_keepalive_interval (socket_, 20);
  g_signal_connect (socket_, "message", G_CALLBACK (on_message), this);
  const auto failed = [] (SoupWebsocketConnection *, GError *error, gpointer self) {
    auto client = static_cast<Client *> (self);
    GST_WARNING_OBJECT (client->log_, "%s: %s", client->label_.c_str (), error->message);
  };
  g_signal_connect (socket_, "error", GCallback (+failed), this);
  g_signal_connect (socket_, "closed", G_CALLBACK (on_closed), this);
}

Client::~Client ()
{
  g_signal_handlers_disconnect_by_data (socket_, this);
  g_object_unref (socket_);
  g_object_unref (input_);
}

/* ---- the connection ---- */

void
Client::on_message (SoupWebsocketConnection *, gint type, GBytes *message, gpointer self)
{
  auto client = static_cast<Client *> (self);
  web_limited_input_restart (client->input_);
  if (client->closing_)
    return;
  gsize size = 0;
  const auto text = static_cast<const char *> (g_bytes_get_data (message, &size));
  if (type != SOUP_WEBSOCKET_DATA_TEXT)
    client->refuse (kCloseUnsupported, "expected text messages");
  else if (size > kMaxMessage)
    client->refuse (
        kCloseTooBig, "a message of more than " + std::to_string (kMaxMessage) + " bytes");
  else if (client->is_too_fast ())
    client->refuse (
        kCloseLimit, "at most " + std::to_string (kMaxMessageRate) + " messages a second");
  else
    client->handle ({text, size});
}

void
Client::on_closed (SoupWebsocketConnection *socket, gpointer self)
{
  auto client = static_cast<Client *> (self);
  GST_INFO_OBJECT (client->log_, "%s left (%u)", client->label_.c_str (),
      soup_websocket_connection_get_close_code (socket));
  client->host_.closed (*client); /* deletes it */
}

void
Client::close (gushort code, const std::string &reason)
{
  closing_ = true;
  if (soup_websocket_connection_get_state (socket_) == SOUP_WEBSOCKET_STATE_OPEN)
    soup_websocket_connection_close (socket_, code, reason.c_str ());
}

void
Client::refuse (gushort code, const std::string &reason)
{
  GST_WARNING_OBJECT (log_, "closing the connection of %s: %s", label_.c_str (), reason.c_str ());
  close (code, reason);
}

void
Client::send_text (const std::string &json)
{
  if (entered_ && !closing_ &&
      soup_websocket_connection_get_state (socket_) == SOUP_WEBSOCKET_STATE_OPEN)
    soup_websocket_connection_send_text (socket_, json.c_str ());
}

void
Client::check_silence ()
{
  const gint64 now = g_get_monotonic_time ();
  if (closing_)
    return;
  if (!entered_ && now - opened_us_ > gint64 (settings_.hello_timeout_ms) * 1000)
    refuse (kCloseTimeout, "no hello in time");
  else if (unacknowledged_since_us_ && now - unacknowledged_since_us_ > kMaxSilence_us)
    refuse (kCloseTimeout, "no acknowledgement for 60 s");
  else if (channel_ && !channel_->is_open () && now - channel_->created_us () > kMaxOpening_us)
    close_channel ("not open within 20 s");
}

bool
Client::is_too_fast ()
{
  const gint64 now = g_get_monotonic_time ();
  if (now - rate_since_us_ >= G_USEC_PER_SEC) {
    rate_since_us_ = now;
    messages_in_second_ = 0;
  }
  return ++messages_in_second_ > kMaxMessageRate;
}

/* ---- messages ---- */

void
Client::handle (std::string_view text)
{
  const auto message = JsonMessage::parse (text);
  const auto type = message ? message->text ("type") : std::nullopt;
  if (!type)
    return refuse (kCloseBadMessage, "expected a JSON object with a string 'type'");
  if (!entered_)
    return enter (*message);
  if (*type == "ack")
    acknowledge (*message);
  else if (*type == "key")
    host_.request_key (*this);
  else if (*type == "rtc" || *type == "rtc-stop" || *type == "answer" || *type == "candidate")
    handle_rtc (*type, *message);
  else if (*type == "ping") {
    const auto time = message->number ("time");
    constexpr double kMax = 9007199254740992; /* 2^53; json-glib wraps larger ones round */
    if (!time || !(std::abs (*time) <= kMax))
      return refuse (kCloseBadMessage, "ping: time: expected a number, at most 2^53");
    gchar number[G_ASCII_DTOSTR_BUF_SIZE];
    g_ascii_dtostr (number, sizeof number, *time);
    send_text (std::string ("{\"type\":\"pong\",\"time\":") + number +
               ",\"server\":" + std::to_string (g_get_monotonic_time ()) + "}");
  } else
    GST_DEBUG_OBJECT (log_, "%s: ignoring a message '%s'", label_.c_str (), type->c_str ());
}

void
Client::enter (const JsonMessage &message)
{
  std::string error;
  const auto hello = parse_hello (message, error);
  if (!hello)
    return refuse (kCloseBadMessage, error);
  if (hello->version != kProtocolVersion)
    return refuse (kCloseVersion, "expected version " + std::to_string (kProtocolVersion));
  const auto admission = host_.admit (address_, hello->token, user_);
  if (admission == Host::Admission::kTooManyWrongTokens)
    return refuse (kCloseLimit, "too many wrong tokens from this address");
  if (admission == Host::Admission::kWrongToken)
    return refuse (kCloseUnauthorized, "wrong or missing token");
  hello_ = *hello;
  hello_.token.clear ();
  label_ += user_.empty () ? "" : " (" + user_ + ")";
  entered_ = true;
  GST_INFO_OBJECT (log_, "%s entered", label_.c_str ());
  send_text (host_.welcome ());
  host_.entered (*this);
}

void
Client::acknowledge (const JsonMessage &message)
{
  const auto number = message.number ("frameSet");
  if (!number || !(*number >= 0 && *number <= G_MAXUINT32 && std::floor (*number) == *number))
    return refuse (kCloseBadMessage, "ack: frameSet: expected a number of a frame set");
  const auto acknowledged = static_cast<guint32> (*number);
  if (sent_ == 0 || gint32 (acknowledged - last_) > 0)
    return refuse (kCloseBadMessage, "ack: frameSet: expected one that was sent");
  unacknowledged_since_us_ = 0;
  while (!in_flight_.empty () && gint32 (acknowledged - in_flight_.front ().number) >= 0) {
    in_flight_bytes_ -= in_flight_.front ().bytes;
    in_flight_.pop_front ();
  }
  if (!in_flight_.empty ())
    unacknowledged_since_us_ = g_get_monotonic_time ();
}

/* ---- the data channel ---- */

void
Client::handle_rtc (const std::string &type, const JsonMessage &message)
{
  if (type == "rtc") {
    if (!host_.offers_rtc ())
      return;
    if (++channels_ > kMaxChannels)
      return refuse (kCloseLimit, "at most " + std::to_string (kMaxChannels) + " data channels");
    if (channel_)
      close_channel ("the client asks for another");
    candidates_ = 0;
    DataChannel::Owner &self = *this;
    channel_ = std::make_unique<DataChannel> (host_.context (), self, settings_);
    return;
  }
  if (!channel_)
    return; /* it has just closed */
  if (type == "rtc-stop")
    return close_channel ("stopped by the client");
  const auto text = message.text (type == "answer" ? "sdp" : "candidate");
  if (!text)
    refuse (kCloseBadMessage, type == "answer" ? "answer: sdp: expected a string"
                                               : "candidate: candidate: expected a string");
  else if (type == "candidate" && ++candidates_ > kMaxCandidates)
    refuse (kCloseLimit, "at most " + std::to_string (kMaxCandidates) + " candidates");
  else if (type == "candidate")
    channel_->add_candidate (*text);
  else if (!channel_->answer (*text))
    refuse (kCloseBadMessage, "answer: sdp: expected the answer to the offer of a data channel");
}

void
Client::signal (const std::string &json)
{
  send_text (json);
}

void
Client::channel_changed (const std::string &error)
{
  if (!channel_->is_open ())
    return close_channel (error);
  GST_INFO_OBJECT (log_, "%s: frame sets go over a data channel", label_.c_str ());
  begin_transport ();
}

void
Client::close_channel (const std::string &reason)
{
  GST_INFO_OBJECT (log_, "%s: data channel closed: %s", label_.c_str (), reason.c_str ());
  begin_transport ();
  channel_.reset ();
}

/* The client may have received nothing by the transport of before. */
void
Client::begin_transport ()
{
  needs_key_ = true;
  rig_units_.reset ();
}

/* ---- frame sets ---- */

/* One frame set is sent however large it is. */
bool
Client::has_room (gsize bytes)
{
  const gint64 now = g_get_monotonic_time ();
  while (!in_flight_.empty () && in_flight_.front ().expires_us < now) {
    in_flight_bytes_ -= in_flight_.front ().bytes;
    in_flight_.pop_front ();
  }
  if (channel_ && channel_->is_open () && channel_->buffered () > kMaxBuffered)
    return false;
  return in_flight_.empty () || (in_flight_.size () < settings_.window &&
                                    in_flight_bytes_ + bytes <= settings_.max_queued_bytes);
}

void
Client::send (const FrameSet &frame_set)
{
  if (!entered_ || closing_ || !hello_.stream ||
      soup_websocket_connection_get_state (socket_) != SOUP_WEBSOCKET_STATE_OPEN)
    return;
  if (!any_)
    first_ = frame_set.number;
  else if (frame_set.number != last_ + 1) /* the server was too busy for one */
    needs_key_ = true;
  needs_key_ |= frame_set.discontinuity;
  any_ = true;
  last_ = frame_set.number;
  last_us_ = g_get_monotonic_time ();
  const bool new_rig = rig_units_ != frame_set.rig_units;
  if (!has_room (g_bytes_get_size (frame_set.units.get ()) +
                 (new_rig ? frame_set.rig_units->size () : 0))) {
    GST_DEBUG_OBJECT (log_, "%s: leaving out frame set %u", label_.c_str (), frame_set.number);
    needs_key_ = true;
    return;
  }
  if (needs_key_ && !frame_set.key)
    return host_.request_key (*this);

  const gint64 now = g_get_monotonic_time ();
  MessageHeader header;
  header.key = frame_set.key;
  header.discontinuity = needs_key_ || new_rig;
  header.frame_set = frame_set.number;
  header.dropped = frame_set.number - first_ - sent_;
  header.sent_us = guint64 (now);
  if (frame_set.captured_us >= 0)
    header.delay_us = guint32 (std::clamp<gint64> (now - frame_set.captured_us, 0, G_MAXINT32));
  const bool by_channel = channel_ && channel_->is_open ();
  const bool with_rig = new_rig || (by_channel && now - rig_sent_us_ >= kRigInterval_us);
  const gsize bytes = by_channel ? send_slices (frame_set, header, with_rig)
                                 : send_message (frame_set, header, with_rig);
  if (bytes == 0) {
    needs_key_ = true;
    return;
  }
  if (with_rig)
    rig_sent_us_ = now;
  if (!unacknowledged_since_us_)
    unacknowledged_since_us_ = now;
  in_flight_.push_back ({frame_set.number, bytes, by_channel ? now + kMaxFlight_us : G_MAXINT64});
  in_flight_bytes_ += bytes;
  rig_units_ = frame_set.rig_units;
  needs_key_ = false;
  sent_++;
  bytes_ += bytes;
}

/* Over the WebSocket, in one message. @return its size in bytes */
gsize
Client::send_message (const FrameSet &frame_set, MessageHeader header, bool with_rig)
{
  gsize size = 0;
  const gconstpointer units = g_bytes_get_data (frame_set.units.get (), &size);
  const gsize rig_size = with_rig ? frame_set.rig_units->size () : 0;
  const gsize whole = MessageHeader::kSize + rig_size + size;
  const auto message = static_cast<guint8 *> (g_malloc (whole));
  header.message = messages_++;
  header.write (message);
  std::memcpy (message + MessageHeader::kSize, frame_set.rig_units->data (), rig_size);
  if (size > 0) /* else there are no bytes to point to */
    std::memcpy (message + MessageHeader::kSize + rig_size, units, size);
  const BytesPtr bytes (g_bytes_new_take (message, whole));
  soup_websocket_connection_send_message (socket_, SOUP_WEBSOCKET_DATA_BINARY, bytes.get ());
  return whole;
}

/* Over the data channel, each unit in a message.
 * @return the size of all in bytes; 0: none was sent, because one is too large or there are too
 * many */
gsize
Client::send_slices (const FrameSet &frame_set, MessageHeader header, bool with_rig)
{
  using Units = std::span<const std::uint8_t>;
  gsize size = 0;
  const auto data = static_cast<const guint8 *> (g_bytes_get_data (frame_set.units.get (), &size));
  const auto rig = reinterpret_cast<const guint8 *> (frame_set.rig_units->data ());
  slices_.clear ();
  for (const Units units :
      {Units (rig, with_rig ? frame_set.rig_units->size () : 0), Units (data, size)}) {
    rangecast::UnitReader reader (units);
    rangecast::UnitHeader unit_header;
    while (const auto unit = reader.next (unit_header))
      slices_.push_back (*unit);
  }
  const auto is_too_large = [] (Units unit) {
    return unit.size () > DataChannel::kMaxMessage - MessageHeader::kSize;
  };
  if (slices_.empty () || slices_.size () > G_MAXUINT16 ||
      std::ranges::any_of (slices_, is_too_large)) {
    close_channel ("a slice is too long for its messages");
    return 0;
  }
  gsize whole = 0;
  header.count = guint16 (slices_.size ());
  for (const Units unit : slices_) {
    const gsize message_size = MessageHeader::kSize + unit.size ();
    const auto message = static_cast<guint8 *> (g_malloc (message_size));
    header.message = channel_messages_++;
    header.write (message);
    std::memcpy (message + MessageHeader::kSize, unit.data (), unit.size ());
    const BytesPtr bytes (g_bytes_new_take (message, message_size));
    channel_->send (bytes.get ());
    header.index++;
    whole += message_size;
  }
  return whole;
}

/* Speech alone is never acknowledged, so it stops where frame sets do, or are not acknowledged
 * either: nothing grows. */
void
Client::send (const AudioPacket &packet)
{
  const gint64 now = g_get_monotonic_time ();
  const bool is_behind =
      now - last_us_ > kMaxSpeechWait_us ||
      (unacknowledged_since_us_ && now - unacknowledged_since_us_ > kMaxSpeechWait_us);
  if (!entered_ || closing_ || !hello_.audio || !any_ || is_behind ||
      soup_websocket_connection_get_state (socket_) != SOUP_WEBSOCKET_STATE_OPEN)
    return;
  gsize size = 0;
  const gconstpointer data = g_bytes_get_data (packet.data.get (), &size);
  const auto message = static_cast<guint8 *> (g_malloc (AudioHeader::kSize + size));
  const AudioHeader header{packet.number, guint64 (packet.captured_us)};
  header.write (message);
  if (size > 0)
    std::memcpy (message + AudioHeader::kSize, data, size);
  const BytesPtr bytes (g_bytes_new_take (message, AudioHeader::kSize + size));
  soup_websocket_connection_send_message (socket_, SOUP_WEBSOCKET_DATA_BINARY, bytes.get ());
  bytes_ += AudioHeader::kSize + size;
}

void
Client::set_audio (bool available)
{
  if (entered_ && hello_.audio)
    send_text (
        std::string ("{\"type\":\"audio\",\"available\":") + (available ? "true}" : "false}"));
}

void
Client::end ()
{
  rig_units_.reset ();
  needs_key_ = true;
  send_text ("{\"type\":\"end\"}");
}

GstStructure *
Client::stats () const
{
  const guint32 passed = any_ ? last_ - first_ + 1 : 0;
  return gst_structure_new ("client", "address", G_TYPE_STRING, address_.c_str (), "user",
      G_TYPE_STRING, user_.c_str (), "transport", G_TYPE_STRING,
      channel_ && channel_->is_open () ? "webrtc" : "websocket", "frame-sets", G_TYPE_UINT64,
      guint64 (sent_), "dropped", G_TYPE_UINT64, guint64 (passed - sent_), "unacknowledged",
      G_TYPE_UINT, guint (in_flight_.size ()), "bytes", G_TYPE_UINT64, bytes_, nullptr);
}

} // namespace web
