/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A viewer that joins gets its first packets when a key frame set begins: what differs from frame
 * sets that it never had would show scraps. Nobody else waits for that key frame set.
 *
 * How: a viewer by UDP is one client of a multiudpsink that all share. It is taken out in the
 * moment that it is put in, and put in again by the thread that sends, just before the first packet
 * of a key frame set. A viewer by TCP has a queue of its own (rtsp-tcp-viewer), which asks
 * begins_key_frame_set(); until the library has put it in and that has taken its place, no frame
 * set begins. Multicast is shared: who joins takes what comes. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

/* So long a viewer waits at most: sources that make no key frame set when asked (recordings). */
inline constexpr gint64 kLongestHold_us = 2 * G_USEC_PER_SEC;

/** Nothing passes while somebody is at work that takes some milliseconds. Any thread. */
class ShortPause {
public:
  /** Returns when what has passed before has got to the viewers, if the machine is not too busy.
   *  Does nothing where the last one is not long ago: who joins must not slow the others down. */
  void begin ();
  void end ();
  /** Waits for the end, 50 ms at most: who began may have failed, or begin again and again. */
  void wait ();

private:
  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  int n_ = 0;           /* at work */
  gint64 since_us_ = 0; /* monotonic; when the last one began */
  gint64 until_us_ = 0; /* monotonic */
};

/** Of one media with one stream. Any thread. */
class JoinGate {
public:
  /** Installs one; to be called when the media is made, before it runs.
   *  @param pipeline   of the media
   *  @param payloader  whose buffers say which frame sets are key frame sets */
  static void install (GstRTSPMedia *media, GstElement *pipeline, GstElement *payloader);
  /** @return nullptr if the media has none */
  static std::shared_ptr<JoinGate> of (GstRTSPMedia *media);

  /** @param packet  of RTP */
  bool begins_key_frame_set (GstBuffer *packet);

  /** A session is about to play. Its UDP viewers wait from now on.
   *  @param pauses  TCP viewers have no queues yet, and frame sets come */
  void hold_back (GstRTSPSessionMedia *media, bool pauses);
  /** It plays, and its TCP viewers have their queues. Those that were let in before need not wait.
   */
  void note_playing (GstRTSPSessionMedia *media);
  /** It left. To be called before the library takes it away. */
  void forget (GstRTSPSessionMedia *media);

private:
  struct Start {
    guint32 timestamp; /* of RTP */
    guint16 sequence;
  };
  struct Joiner {
    std::shared_ptr<GWeakRef> transport;
    std::string host;
    int port;
    gint64 until_us;              /* monotonic */
    GstElement *parked = nullptr; /* multiudpsink that it was taken out of; not owned */
    bool left = false;            /* while it was entering */

    bool is_to (const GstRTSPTransport &to) const
    {
      return port == to.client_port.min && host == to.destination;
    }
  };
  static bool read_start (GstBuffer *packet, Start &start);
  static GstPadProbeReturn on_frame_set (GstPad *, GstPadProbeInfo *info, gpointer gate);
  static GstPadProbeReturn on_payload (GstPad *, GstPadProbeInfo *info, gpointer gate);
  static GstPadProbeReturn before_sending (GstPad *pad, GstPadProbeInfo *info, gpointer gate);
  static void on_element (GstBin *, GstElement *element, gpointer gate);
  static void on_client (GstElement *sink, gchar *host, gint port, gpointer gate);
  using UseAddress = std::function<void (const GstRTSPTransport &, GstRTSPStreamTransport *)>;
  void for_each_address (GstRTSPSessionMedia *media, const UseAddress &use);
  void let_in (GstElement *sink, bool is_key);
  bool has_left (const Joiner &entered);

  std::atomic<bool> is_key_ = true; /* what the payloader is at; its thread writes */
  guint32 last_timestamp_ = 0;      /* thread of the payloader */
  bool has_last_ = false;
  std::atomic<int> waiting_ = 0; /* joiners */
  ShortPause pause_;             /* before a frame set begins */

  std::mutex lock_; /* guards what follows; not held while anything is called */
  std::array<Start, 8> starts_ = {};
  std::size_t n_starts_ = 0; /* ever */
  std::vector<Joiner> joiners_;
  std::vector<Joiner> entering_; /* that are being put in again */
};
