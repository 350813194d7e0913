/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "client.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "server.hpp"

namespace web {

namespace {

/** Browsers send hello as soon as the connection is open. */
constexpr gint64 kMaxHelloWait_us = 5 * G_USEC_PER_SEC;
/** Without an acknowledgement for so long a client is gone, microseconds. */
constexpr gint64 kMaxSilence_us = 60 * G_USEC_PER_SEC;
/** Speech waits for a client whose frame sets have not been acknowledged for so long. */
constexpr gint64 kMaxSpeechWait_us = G_USEC_PER_SEC;
/** Bytes in flight to a client, unless one frame set has more: a second at 32 Mbit/s. */
constexpr gsize kMaxInFlightBytes = 4 << 20;
/** Payload of a control frame, bytes (RFC 6455). */
constexpr gsize kMaxControl = 125;

constexpr const char *kClient = "client"; /* data of the extension */

GBytes *
filter_frame (SoupWebsocketExtension *self, guint8 *header, GBytes *payload, GError **)
{
  auto client = static_cast<Client *> (g_object_get_data (G_OBJECT (self), kClient));
  if (client && client->takes_frame (*header, g_bytes_get_size (payload)))
    return payload;
  g_bytes_unref (payload);
  return g_bytes_new (nullptr, 0);
}

} // namespace

/* libsoup 3.2 limits the size of a frame, but neither the fragments of a message nor the number of
 * pings, which it answers. An extension sees each frame. */
GList *
client_extensions ()
{
  const GClassInitFunc init = [] (gpointer klass, gpointer) {
    SOUP_WEBSOCKET_EXTENSION_CLASS (klass)->process_incoming_message = filter_frame;
  };
  static const GType type = g_type_register_static_simple (SOUP_TYPE_WEBSOCKET_EXTENSION,
      "GstRangeWebSinkFrameFilter", sizeof (SoupWebsocketExtensionClass), init,
      sizeof (SoupWebsocketExtension), nullptr, GTypeFlags (0));
  return g_list_append (nullptr, g_object_new (type, nullptr));
}

Client::Client (Server &server, SoupWebsocketConnection *socket, GSocket *tcp, std::string address)
    : server_ (server), log_ (server.element ()),
      socket_ (SOUP_WEBSOCKET_CONNECTION (g_object_ref (socket))),
      tcp_ (G_SOCKET (g_object_ref (tcp))), label_ (std::move (address)),
      opened_us_ (g_get_monotonic_time ())
{
  extension_ = static_cast<GObject *> (soup_websocket_connection_get_extensions (socket_)->data);
  g_object_set_data (extension_, kClient, this);
  soup_websocket_connection_set_keepalive_interval (socket_, 20);
  g_signal_connect (socket_, "message", G_CALLBACK (on_message), this);
  const auto failed = [] (SoupWebsocketConnection *, GError *error, gpointer self) {
    auto client = static_cast<Client *> (self);
    GST_WARNING_OBJECT (client->log_, "%s: %s", client->label_.c_str (), error->message);
    if (std::exchange (client->closing_, true)) /* libsoup keeps all that follows a bad frame */
      g_socket_shutdown (client->tcp_, TRUE, TRUE, nullptr);
  };
  g_signal_connect (socket_, "error", GCallback (+failed), this);
  g_signal_connect (socket_, "closed", G_CALLBACK (on_closed), this);
}

Client::~Client ()
{
  g_object_set_data (extension_, kClient, nullptr);
  g_signal_handlers_disconnect_by_data (socket_, this);
  g_object_unref (socket_);
  g_object_unref (tcp_);
}

/* ---- the connection ---- */

void
Client::on_message (SoupWebsocketConnection *, gint type, GBytes *message, gpointer self)
{
  auto client = static_cast<Client *> (self);
  if (client->closing_)
    return;
  gsize size = 0;
  const auto text = static_cast<const char *> (g_bytes_get_data (message, &size));
  if (type != SOUP_WEBSOCKET_DATA_TEXT)
    client->refuse (kCloseUnsupported, "only text messages are accepted");
  else
    client->handle ({text, size});
}

bool
Client::takes_frame (guint8 header, gsize size)
{
  const bool is_control = header & 0x08, is_last = header & 0x80;
  const gsize bytes = is_control ? size : message_bytes_ += size;
  const gint64 now = g_get_monotonic_time ();
  if (closing_)
    return is_control;
  if (now - rate_since_us_ >= G_USEC_PER_SEC) {
    rate_since_us_ = now;
    frames_in_second_ = 0;
  }
  if (bytes > (is_control ? kMaxControl : kMaxMessage))
    refuse (kCloseTooBig, "a message of more than " + std::to_string (kMaxMessage) +
                              " bytes, or a control frame of more than 125");
  else if (++frames_in_second_ > kMaxFrameRate)
    refuse (kCloseLimit, "at most " + std::to_string (kMaxFrameRate) + " messages a second");
  if (!is_control && is_last)
    message_bytes_ = 0;
  return is_control || !closing_;
}

void
Client::on_closed (SoupWebsocketConnection *socket, gpointer self)
{
  auto client = static_cast<Client *> (self);
  GST_INFO_OBJECT (client->log_, "%s left (%u)", client->label_.c_str (),
      soup_websocket_connection_get_close_code (socket));
  client->server_.remove (*client); /* deletes it */
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

bool
Client::can_receive () const
{
  return admitted_ && !closing_ &&
         soup_websocket_connection_get_state (socket_) == SOUP_WEBSOCKET_STATE_OPEN;
}

void
Client::send_text (const std::string &json)
{
  if (can_receive ())
    soup_websocket_connection_send_text (socket_, json.c_str ());
}

/* Takes the message. */
void
Client::send_binary (guint8 *message, gsize size)
{
  const BytesPtr bytes (g_bytes_new_take (message, size));
  soup_websocket_connection_send_message (socket_, SOUP_WEBSOCKET_DATA_BINARY, bytes.get ());
  server_.counters ().bytes += size;
}

void
Client::check ()
{
  const gint64 now = g_get_monotonic_time ();
  if (closing_)
    return;
  if (!admitted_ && now - opened_us_ > kMaxHelloWait_us)
    refuse (kCloseTimeout, "no hello in time");
  else if (unacknowledged_since_us_ && now - unacknowledged_since_us_ > kMaxSilence_us)
    refuse (kCloseTimeout, "no acknowledgement for 60 s");
}

/* ---- messages ---- */

void
Client::handle (std::string_view text)
{
  const auto message = JsonMessage::parse (text);
  const auto type = message ? message->text ("type") : std::nullopt;
  if (!type)
    return refuse (kCloseBadMessage, "not a JSON object with a string 'type'");
  if (!admitted_)
    return enter (*message);
  if (*type == "call") {
    if (Client *partner = server_.partner_of (*this))
      partner->send_text (std::string (text));
    return;
  }
  if (*type == "ack")
    acknowledge (*message);
  else if (*type == "key")
    server_.request_key (*this);
  else if (*type == "ping") {
    const auto time = message->number ("time");
    constexpr double kMax = 9007199254740992; /* 2^53; json-glib wraps larger ones round */
    if (!time || !(std::abs (*time) <= kMax))
      return refuse (kCloseBadMessage, "ping: time must be a number, at most 2^53");
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
  std::string error, user;
  const auto hello = parse_hello (message, error);
  if (!hello)
    return refuse (kCloseBadMessage, error);
  if (hello->version != kProtocolVersion)
    return refuse (kCloseVersion, "this server has version " + std::to_string (kProtocolVersion));
  if (!server_.admit (hello->token, user))
    return refuse (kCloseUnauthorized, "wrong or missing token");
  if (hello->room && server_.is_full (*hello->room))
    return refuse (kCloseLimit, "the call already has two participants");
  hello_ = *hello;
  hello_.token.clear ();
  label_ += user.empty () ? "" : " (" + user + ")";
  admitted_ = true;
  GST_INFO_OBJECT (log_, "%s entered", label_.c_str ());
  send_text (server_.welcome ());
  if (Client *partner = server_.partner_of (*this))
    partner->send_text (R"({"type":"joined"})");
}

void
Client::acknowledge (const JsonMessage &message)
{
  const auto number = message.number ("frameSet");
  if (!number || !(*number >= 0 && *number <= G_MAXUINT32 && std::floor (*number) == *number))
    return refuse (kCloseBadMessage, "ack: frameSet must be the number of a frame set");
  const auto acknowledged = static_cast<guint32> (*number);
  if (sent_ == 0 || gint32 (acknowledged - last_) > 0)
    return refuse (kCloseBadMessage, "ack: frameSet was not sent");
  while (!in_flight_.empty () && gint32 (acknowledged - in_flight_.front ().number) >= 0) {
    in_flight_bytes_ -= in_flight_.front ().bytes;
    in_flight_.pop_front ();
  }
  unacknowledged_since_us_ = in_flight_.empty () ? 0 : g_get_monotonic_time ();
}

/* ---- the stream ---- */

/* One frame set is sent however large it is. */
bool
Client::has_room (gsize bytes) const
{
  return in_flight_.empty () || (in_flight_.size () < server_.settings ().window &&
                                    in_flight_bytes_ + bytes <= kMaxInFlightBytes);
}

void
Client::send (const FrameSet &frame_set)
{
  if (!can_receive () || !hello_.stream)
    return;
  const gint64 now = g_get_monotonic_time ();
  if (!any_)
    first_ = frame_set.number;
  else if (frame_set.number != last_ + 1) /* the server was too busy for one */
    needs_key_ = true;
  needs_key_ |= frame_set.discontinuity;
  any_ = true;
  last_ = frame_set.number;
  last_us_ = now;
  gsize size = 0;
  const gconstpointer units = g_bytes_get_data (frame_set.units.get (), &size);
  const gsize whole = MessageHeader::kSize + size;
  if (!has_room (whole)) {
    GST_DEBUG_OBJECT (log_, "%s: skipping frame set %u", label_.c_str (), frame_set.number);
    needs_key_ = true;
    return;
  }
  if (needs_key_ && !frame_set.key)
    return server_.request_key (*this);

  MessageHeader header;
  header.key = frame_set.key;
  header.discontinuity = needs_key_;
  header.frame_set = frame_set.number;
  header.dropped = frame_set.number - first_ - sent_;
  header.sent_us = guint64 (now);
  if (frame_set.captured_us >= 0)
    header.delay_us = guint32 (std::clamp<gint64> (now - frame_set.captured_us, 0, G_MAXINT32));
  const auto message = static_cast<guint8 *> (g_malloc (whole));
  header.write (message);
  if (size > 0) /* else there are no bytes to point to */
    std::memcpy (message + MessageHeader::kSize, units, size);
  send_binary (message, whole);
  if (!unacknowledged_since_us_)
    unacknowledged_since_us_ = now;
  in_flight_.push_back ({frame_set.number, whole});
  in_flight_bytes_ += whole;
  needs_key_ = false;
  sent_++;
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
  if (!can_receive () || !hello_.audio || !any_ || is_behind)
    return;
  gsize size = 0;
  const gconstpointer data = g_bytes_get_data (packet.data.get (), &size);
  const auto message = static_cast<guint8 *> (g_malloc (AudioHeader::kSize + size));
  const AudioHeader header{packet.number, guint64 (packet.captured_us)};
  header.write (message);
  if (size > 0)
    std::memcpy (message + AudioHeader::kSize, data, size);
  send_binary (message, AudioHeader::kSize + size);
}

void
Client::set_audio (bool available)
{
  if (hello_.audio)
    send_text (
        std::string ("{\"type\":\"audio\",\"available\":") + (available ? "true}" : "false}"));
}

void
Client::end ()
{
  needs_key_ = true;
  send_text ("{\"type\":\"end\"}");
}

} // namespace web
