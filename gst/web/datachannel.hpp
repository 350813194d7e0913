/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <gst/webrtc/webrtc.h>

#include <memory>
#include <string>

#include "settings.hpp"

namespace web {

/** A client's WebRTC data channel: a webrtcbin in a pipeline of its own. The server's thread only.
 *
 *  webrtcbin calls back on threads of its own. What they find out reaches the owner as sources of
 *  the server's main context; `Link` is what both sides share, and knows when the owner is gone. */
class DataChannel {
public:
  /** Called on the server's thread. */
  class Owner {
  public:
    virtual ~Owner () = default;
    /** A message of the protocol to the client. */
    virtual void signal (const std::string &json) = 0;
    /** The channel has opened, or closed. @param error  why it closed */
    virtual void channel_changed (const std::string &error) = 0;
  };

  /** Maximum size of a message, bytes: webrtcbin's max-message-size. */
  static constexpr gsize kMaxMessage = 65536;

  /** @return whether the elements that a channel needs are installed; `missing` names the first
   * that is not */
  static bool is_supported (std::string &missing);
  /** @return whether the process has file descriptors for another channel */
  static bool has_room ();

  /** Begins to offer a channel to the client. @param context  of the server's thread */
  DataChannel (GMainContext *context, Owner &owner, const Settings &settings);
  /** Closes the channel, without waiting for that. */
  ~DataChannel ();
  DataChannel (const DataChannel &) = delete;
  DataChannel &operator= (const DataChannel &) = delete;

  /** @return false if `sdp` is not the answer of a client of the protocol */
  bool answer (const std::string &sdp);
  void add_candidate (const std::string &candidate);

  [[nodiscard]] bool is_open () const { return open_; }
  [[nodiscard]] gint64 created_us () const { return created_us_; }
  /** Bytes that wait in this process to be sent. */
  [[nodiscard]] guint64 buffered () const;
  /** Sends a message of at most kMaxMessage bytes. Takes no reference. */
  void send (GBytes *message);

private:
  struct Link;

  static void open (GstElement *pipeline, const std::shared_ptr<Link> &link);
  void change (bool open, const std::string &error);
  static void offer (GstElement *webrtc, const std::shared_ptr<Link> &link);
  static void on_candidate (GstElement *webrtc, guint line, gchar *candidate, gpointer link);
  static void on_connection_state (GstElement *webrtc, GParamSpec *, gpointer link);

  std::shared_ptr<Link> link_;
  Owner &owner_;
  GstElement *pipeline_, *webrtc_;
  std::shared_ptr<GstWebRTCDataChannel> channel_; /* once it was open */
  bool open_ = false, closed_ = false, answered_ = false;
  gint64 created_us_;
};

} // namespace web
