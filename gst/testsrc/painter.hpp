/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

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
  /** Draws looped pictures again, for a new frame rate. */
  void clear_loops ();

  /** Fixed except for the format of raw video, which its pads' templates have. Transfer full. */
  [[nodiscard]] GstCaps *make_range_caps (int fps_n, int fps_d) const;
  [[nodiscard]] GstCaps *make_raw_caps (int fps_n, int fps_d) const;

  rangecast::Status draw_raw (rangecast::SceneCamera camera, const GstVideoInfo &video,
      const FrameTime &time, GstBuffer *buffer);
  /** @param buffer  of a GstRangeBufferPool */
  rangecast::Status draw_range (const FrameTime &time, GstBuffer *buffer);

private:
  /* The pictures that one camera repeats. */
  struct Loop {
    std::vector<rangecast::Rgbx> pictures; // one below the other; none before the first is shown
    std::vector<bool> drawn;               // each when it is first shown
  };

  rangecast::Status render (rangecast::SceneCamera camera, const FrameTime &time, double period_s,
      rangecast::ImageView<rangecast::Rgbx> picture);
  rangecast::Status make_loop (rangecast::SceneCamera camera);
  rangecast::Status find_looped (rangecast::SceneCamera camera, const FrameTime &time,
      double period_s, rangecast::ImageView<const rangecast::Rgbx> &found);
  [[nodiscard]] bool empty_at (const FrameTime &time) const
  {
    return time.index < settings_.empty_frames;
  }

  AvatarSettings settings_;
  std::unique_ptr<rangecast::Scene> scene_;
  Loop loops_[3]; ///< by camera
};
