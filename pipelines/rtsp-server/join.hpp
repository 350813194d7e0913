/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* gst-rtsp-server sends to a viewer from PLAY on. Frame sets that refer to earlier ones, which the
 * viewer never got, decode to fragments, so here its first packet is the first one of a key frame
 * set; other viewers do not wait for it.
 *
 * UDP viewers are clients of one multiudpsink. A new client is removed from it in "client-added",
 * and added again by the streaming thread just before the first packet of a key frame set. TCP
 * viewers have a queue of their own (tcp-viewer.cpp), which asks begins_key_frame_set(); no frame
 * set begins between gst-rtsp-server's adding its transport and the queue's replacing it. Multicast
 * viewers share what is sent. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

/* Recordings make no key frame set on request: a viewer waits no longer than this. */
inline constexpr gint64 kMaxHold_us = 2 * G_USEC_PER_SEC;

/** Holds the stream for some milliseconds while transports change. Any thread. */
class ShortPause {
public:
  /** Also waits for packets that passed before to reach the transports. Does nothing within 100 ms
   *  of the last pause, so that many joining viewers do not slow the others down. */
  void begin ();
  void end ();
  /** Streaming thread: waits for end(), 50 ms at most, since a PLAY may fail. */
  void wait ();

private:
  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  int n_ = 0;           /* begun, not ended */
  gint64 since_us_ = 0; /* monotonic; when the last one began */
  gint64 until_us_ = 0; /* monotonic */
};

/** What identifies a packet. */
struct RtpStart {
  guint32 timestamp;
  guint16 sequence;

  bool operator== (const RtpStart &) const = default;
};

/** RFC 3550, 5.1; nothing for RTCP, whose packet types are 192 to 223 (RFC 5761, 4). */
std::optional<RtpStart> read_rtp_start (GstBuffer *packet);

/** Of one media with one stream. Any thread. */
class JoinGate {
public:
  /** For a media that is not prepared yet.
   *  @param pipeline   of the media
   *  @param payloader  gets frame sets; those without DELTA_UNIT are key frame sets */
  static void install (GstRTSPMedia *media, GstElement *pipeline, GstElement *payloader);
  /** @return nullptr if the media has none */
  static std::shared_ptr<JoinGate> of (GstRTSPMedia *media);

  /** @param packet  of RTP */
  bool begins_key_frame_set (const RtpStart &packet);

  /** Before PLAY: UDP viewers of the session wait from now on.
   *  @param pauses  the media plays, and TCP viewers of the session have no queues yet */
  void hold_back (GstRTSPSessionMedia *media, bool pauses);
  /** After PLAY: TCP viewers have their queues; UDP viewers that were added before need not wait.
   */
  void handle_playing (GstRTSPSessionMedia *media);
  /** Before gst-rtsp-server removes its transports. */
  void remove (GstRTSPSessionMedia *media);

private:
  struct Joiner {
    std::shared_ptr<GWeakRef> transport;
    std::string host;
    int port;
    gint64 until_us;              /* monotonic */
    GstElement *parked = nullptr; /* multiudpsink that it was removed from; not owned */
    bool left = false;            /* while it was being added again */

    bool is_to (const GstRTSPTransport &to) const
    {
      return port == to.client_port.min && host == to.destination;
    }
  };
  static GstPadProbeReturn on_frame_set (GstPad *, GstPadProbeInfo *info, gpointer gate);
  static GstPadProbeReturn on_payload (GstPad *, GstPadProbeInfo *info, gpointer gate);
  static GstPadProbeReturn before_sending (GstPad *pad, GstPadProbeInfo *info, gpointer gate);
  static void on_element (GstBin *, GstElement *element, gpointer gate);
  static void on_client (GstElement *sink, gchar *host, gint port, gpointer gate);
  using UseAddress = std::function<void (const GstRTSPTransport &, GstRTSPStreamTransport *)>;
  void for_each_address (GstRTSPSessionMedia *media, const UseAddress &use);
  void add_waiting (GstElement *sink, bool is_key);
  bool has_left (const Joiner &entered);

  std::atomic<bool> is_key_ = true; /* the frame set in the payloader; written by its thread */
  guint32 last_timestamp_ = 0;      /* payloader's thread */
  bool has_last_ = false;
  std::atomic<int> waiting_ = 0; /* joiners */
  ShortPause pause_;             /* before a frame set begins */

  std::mutex lock_; /* guards what follows; no calls with it */
  std::array<RtpStart, 8> starts_ = {};
  std::size_t n_starts_ = 0; /* ever */
  std::vector<Joiner> joiners_;
  std::vector<Joiner> entering_; /* that are being added again */
};
