/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <variant>

#include "client.hpp"

namespace web {

struct EndOfStream {};
/** Speech begins to be available, or ends. */
struct SpeechChange {
  bool available;
};
using StreamItem = std::variant<FrameSet, AudioPacket, EndOfStream, SpeechChange>;

/** Hands frame sets and speech from the streaming threads to the server's thread. What is pushed
 *  does not wait for that thread; if too much waits there, it is dropped.
 *
 *  Locking: `lock_` guards all members but the constants; `deliver` is called without it. */
class StreamQueue {
public:
  using Deliver = std::function<void (const StreamItem &)>;
  /** @param element  for the log
   *  @param deliver  is called in `context`, in the order of pushing */
  StreamQueue (GstObject *element, GMainContext *context, Deliver deliver);
  StreamQueue (const StreamQueue &) = delete;
  StreamQueue &operator= (const StreamQueue &) = delete;

  /** @name Any thread @{ */
  void set_rig (std::string rig_units);
  /** Takes the frame set and numbers it. @param captured_us, discontinuity  see FrameSet */
  void push (BytesPtr units, bool key, bool discontinuity, gint64 captured_us);
  /** Takes a packet of speech. @param captured_us  on g_get_monotonic_time() */
  void push_audio (BytesPtr packet, gint64 captured_us);
  /** Whether there is speech to hear. */
  void set_audio (bool available);
  [[nodiscard]] bool has_audio ();
  void end ();
  /** Drops the frame sets that wait; the next one does not continue them. */
  void flush ();
  /** How many were pushed. */
  [[nodiscard]] guint64 frame_sets ();
  /** @} */

private:
  void add (StreamItem item);
  void deliver ();

  GstObject *const element_;
  GMainContext *const context_;
  const Deliver deliver_;

  std::mutex lock_;
  std::deque<StreamItem> items_;
  bool woken_ = false;
  bool flushed_ = false; /* since the last frame set */
  bool has_audio_ = false;
  std::shared_ptr<const std::string> rig_units_;
  guint64 frame_sets_ = 0;
  guint32 next_audio_ = 0;
};

} // namespace web
