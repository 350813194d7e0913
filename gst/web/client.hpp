/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <libsoup/soup.h>

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "datachannel.hpp"
#include "limitedinput.h"
#include "pagefiles.hpp"
#include "protocol.hpp"
#include "settings.hpp"

namespace web {

/** A coded frame set on its way to all clients. */
struct FrameSet {
  BytesPtr units;
  std::shared_ptr<const std::string> rig_units; ///< of the rig that it belongs to
  bool key;                                     ///< refers to no earlier frame set
  bool discontinuity;                           ///< does not continue the ones before
  guint32 number;
  gint64 captured_us; ///< on g_get_monotonic_time(); -1: unknown
};

/** A packet of Opus (RFC 6716) on its way to the clients that want to hear. */
struct AudioPacket {
  BytesPtr data;
  guint32 number;
  gint64 captured_us; ///< on g_get_monotonic_time()
};

/** A browser: its WebSocket, and its data channel if it has one. The server's thread only. */
class Client : private DataChannel::Owner {
public:
  /** What a client needs from the server. */
  class Host {
  public:
    virtual ~Host () = default;
    enum class Admission { kAdmitted, kWrongToken, kTooManyWrongTokens };
    /** @param address  of the client
     *  @param[out] name  of the user, if tokens have names */
    virtual Admission admit (
        const std::string &address, const std::string &token, std::string &name) = 0;
    virtual void request_key (Client &client) = 0;
    virtual std::string welcome () = 0; ///< the message
    virtual bool offers_rtc () = 0;
    virtual GMainContext *context () = 0; ///< of the server's thread
    virtual void entered (Client &client) = 0;
    virtual void closed (Client &client) = 0;
  };

  Client (GstObject *log, Host &host, const Settings &settings, SoupWebsocketConnection *socket,
      WebLimitedInput *input, std::string address);
  ~Client () override;
  Client (const Client &) = delete;
  Client &operator= (const Client &) = delete;

  /** Sends it, if the client is ready for it. */
  void send (const FrameSet &frame_set);
  /** Sends it, if the client wants to hear and keeps up. Always over the WebSocket. */
  void send (const AudioPacket &packet);
  /** The stream has ended; what is sent next begins another one. */
  void end ();
  /** Tells a client that wants to hear whether there is speech. */
  void set_audio (bool available);
  /** Sends a text message, if the client was let in. */
  void send_text (const std::string &json);
  void close (gushort code, const std::string &reason);
  /** Once a second: closes clients that have been silent for too long. */
  void check_silence ();

  [[nodiscard]] bool was_let_in () const { return entered_; }
  [[nodiscard]] bool wants_stats () const { return entered_ && hello_.stats; }
  [[nodiscard]] const std::string &label () const { return label_; }
  /** Structure "client". Returns: (transfer full) */
  [[nodiscard]] GstStructure *stats () const;
  [[nodiscard]] guint64 bytes () const { return bytes_; }
  guint64 stats_sent = 0; ///< see StatsBoard::message()

private:
  struct InFlight {
    guint32 number;
    gsize bytes;
    gint64 expires_us; /* no acknowledgement is expected after that */
  };

  static void on_message (SoupWebsocketConnection *, gint type, GBytes *message, gpointer self);
  static void on_closed (SoupWebsocketConnection *, gpointer self);
  void handle (std::string_view text);
  void enter (const JsonMessage &message);
  void acknowledge (const JsonMessage &message);
  [[nodiscard]] bool is_too_fast ();
  void signal (const std::string &json) override;
  void channel_changed (const std::string &error) override;
  void handle_rtc (const std::string &type, const JsonMessage &message);
  void close_channel (const std::string &reason);
  void begin_transport ();
  [[nodiscard]] bool has_room (gsize bytes);
  gsize send_message (const FrameSet &frame_set, MessageHeader header, bool with_rig);
  gsize send_slices (const FrameSet &frame_set, MessageHeader header, bool with_rig);
  void refuse (gushort code, const std::string &reason);

  GstObject *log_;
  Host &host_;
  const Settings &settings_;
  SoupWebsocketConnection *socket_;
  WebLimitedInput *input_; /* of the socket */
  std::string address_, label_, user_;
  Hello hello_;
  bool entered_ = false, closing_ = false;
  guint64 entered_us_ = 0;
  gint64 opened_us_, rate_since_us_ = 0;
  guint messages_in_second_ = 0;
  std::unique_ptr<DataChannel> channel_;
  guint channels_ = 0, candidates_ = 0; /* asked for, received */

  /* frame sets */
  bool any_ = false;                            /* the counts below have begun */
  bool needs_key_ = true;                       /* an earlier frame set was not sent */
  guint32 first_ = 0;                           /* number of the first frame set since welcome */
  guint32 last_ = 0;                            /* of the last one that came by */
  gint64 last_us_ = 0;                          /* when that was */
  guint32 sent_ = 0;                            /* frame sets */
  guint32 messages_ = 0, channel_messages_ = 0; /* on the WebSocket, on the data channel */
  gint64 unacknowledged_since_us_ = 0;          /* 0: all is acknowledged */
  gint64 rig_sent_us_ = 0;
  guint64 bytes_ = 0;
  gsize in_flight_bytes_ = 0;
  std::deque<InFlight> in_flight_;
  std::shared_ptr<const std::string> rig_units_;      /* that the client has */
  std::vector<std::span<const std::uint8_t>> slices_; /* of the frame set that is sent */
};

} // namespace web
