/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <memory>
#include <mutex>
#include <vector>

enum class AvatarPadKind { kLeft, kRight, kThird, kRange };

/** One request pad of avatartestsrc and its stream. For the streaming thread, or for
 *  whoever has made it stand still; but set_flushing(), pad() and kind() for any. */
class AvatarPad {
public:
  AvatarPad (GstPad *pad, AvatarPadKind kind);
  ~AvatarPad ();
  AvatarPad (const AvatarPad &) = delete;
  AvatarPad &operator= (const AvatarPad &) = delete;

  [[nodiscard]] GstPad *pad () const { return pad_; }
  [[nodiscard]] AvatarPadKind kind () const { return kind_; }
  /** Of negotiated raw video. */
  [[nodiscard]] const GstVideoInfo &video () const { return video_; }

  /** Asks once a frame: takes the pad's mark of RECONFIGURE away. */
  bool needs_negotiation ();
  /** What the peer takes of our formats. */
  [[nodiscard]] GstCaps *peer_caps () const;
  /** Sends fixed caps, if they are others than the last, and takes buffers as the peer wants them.
   *  @param caps  empty: the peer takes none */
  bool negotiate (GstCaps *caps);

  /** GST_FLOW_NOT_LINKED, GST_FLOW_EOS: the peer wants none. */
  GstFlowReturn acquire (GstBuffer **buffer);
  GstFlowReturn push (GstBuffer *buffer);

  /** Each but once in a stream. */
  void push_stream_start (GstElement *element, guint group_id);
  void push_segment (const GstSegment &segment, guint32 seqnum);
  void push_end (GstEvent *event);

  /** The stream goes on elsewhere: a segment is due. */
  void restart ();
  /** There is no stream any more. */
  void stop ();

  /** Any thread. While true, acquire() does not wait for a buffer to come back. */
  void set_flushing (bool flushing);

private:
  bool configure (GstBufferPool *pool, GstQuery *query, GstCaps *caps, guint size);
  GstBufferPool *make_pool (GstCaps *caps, GstQuery *query);
  void take_pool (GstBufferPool *pool);

  GstPad *pad_;
  AvatarPadKind kind_;
  bool needs_start_ = true, needs_segment_ = true, discont_ = true, negotiated_ = false,
       peer_ended_ = false, ended_ = false;
  GstVideoInfo video_{};

  std::mutex lock_; /* guards the two below; pool_ is written by the streaming thread alone */
  GstBufferPool *pool_ = nullptr;
  bool flushing_ = false;
};

using AvatarPads = std::vector<std::shared_ptr<AvatarPad>>;

/** What all pads have in common. */
struct AvatarFormat {
  int width, height; ///< pixels
  int fps_n, fps_d;  ///< frames a second
};

/** The size and rate that all peers take, nearest to 320 x 240 at 30/s.
 *  @return false if there is none */
bool avatar_choose_format (const AvatarPads &pads, AvatarFormat &format);
