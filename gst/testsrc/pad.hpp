/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <memory>
#include <vector>

enum class AvatarPadKind { kLeft, kRight, kThird, kRange };

/** One request pad of avatartestsrc and its stream. For the streaming thread, or while it does not
 *  run; pad() and kind() for any thread. */
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

  /** Call once a frame: resets the pad's RECONFIGURE flag. */
  bool needs_negotiation ();
  /** The formats of the template that the peer accepts. Transfer full. */
  [[nodiscard]] GstCaps *peer_caps () const;
  /** Sends fixed caps, if they have changed, and sets up a buffer pool.
   *  @param caps  empty: the peer accepts none
   *  @return false if the peer refuses them */
  bool negotiate (GstCaps *caps);

  /** @return GST_FLOW_NOT_LINKED, GST_FLOW_EOS: the peer takes no more */
  GstFlowReturn acquire (GstBuffer **buffer);
  GstFlowReturn push (GstBuffer *buffer);

  /** Each does nothing if the stream has had it. */
  void push_stream_start (GstElement *element, guint group_id);
  void push_segment ();
  void push_eos ();

  /** The stream has ended. */
  void stop ();

private:
  GstBufferPool *make_pool (GstCaps *caps, GstQuery *query);
  void set_pool (GstBufferPool *pool);

  GstPad *pad_;
  AvatarPadKind kind_;
  bool needs_start_ = true, needs_segment_ = true, discont_ = true, negotiated_ = false,
       peer_ended_ = false, ended_ = false;
  GstVideoInfo video_{};

  GstBufferPool *pool_ = nullptr;
};

using AvatarPads = std::vector<std::shared_ptr<AvatarPad>>;

/** Size and rate of all pads. */
struct AvatarFormat {
  int width, height; ///< pixels
  int fps_n, fps_d;  ///< frames a second
};

/** The size and rate that all peers accept, nearest to 320 x 240 at 30/s.
 *  @return false if there is none */
bool avatar_choose_format (const AvatarPads &pads, AvatarFormat &format);
