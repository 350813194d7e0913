/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <functional>
#include <memory>
#include <rangecast/scene/scene.hpp>
#include <vector>

#include "clock.hpp"
#include "settings.hpp"

/** Draws the scene into buffers. Streaming thread only. */
class AvatarPainter {
public:
  /** Drops the scene. */
  void start (const AvatarSettings &settings);
  /** Creates the scene, if its size has changed, and writes its rig file. */
  rangecast::Status set_size (int width, int height);
  /** Frees the looped pictures, which depend on the frame rate. */
  void clear_loops ();
  /** Draws a camera's looped pictures unless there are any; without all of them, there are none. */
  rangecast::Status draw_loop (
      rangecast::SceneCamera camera, double period_s, const std::function<bool ()> &goes_on);

  /** Fixed except for the format of raw video, which its pads' templates have. Transfer full. */
  [[nodiscard]] GstCaps *make_range_caps (int fps_n, int fps_d) const;
  [[nodiscard]] GstCaps *make_raw_caps (int fps_n, int fps_d) const;

  rangecast::Status draw_raw (rangecast::SceneCamera camera, const GstVideoInfo &video,
      const FrameTime &time, GstBuffer *buffer);
  /** @param buffer  of a GstRangeBufferPool */
  rangecast::Status draw_range (const FrameTime &time, GstBuffer *buffer);

private:
  rangecast::Status render (rangecast::SceneCamera camera, const FrameTime &time,
      rangecast::ImageView<rangecast::Rgbx> picture);
  rangecast::ImageView<rangecast::Rgbx> looped (rangecast::SceneCamera camera, guint64 i);
  [[nodiscard]] bool empty_at (const FrameTime &time) const
  {
    return time.index < settings_.empty_frames;
  }

  AvatarSettings settings_;
  std::unique_ptr<rangecast::Scene> scene_;
  std::vector<rangecast::Rgbx> loops_[3]; ///< by camera: pictures one below the other
};
