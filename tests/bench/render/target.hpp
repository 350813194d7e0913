/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "ways.hpp"

namespace bench {

/** A picture to draw into, kWidth x kHeight. All in the GL thread. */
class Target {
public:
  explicit Target (GstGLContext *context);
  ~Target ();
  Target (const Target &) = delete;
  Target &operator= (const Target &) = delete;

  [[nodiscard]] bool usable () const { return memory_ && framebuffer_; }
  /** Draws once. @return bytes uploaded; the GPU has finished */
  guint64 draw (Way &way, const rangecast::SurfacePicture &picture);
  /** What a way drew last; CV_8UC4, RGBA */
  [[nodiscard]] cv::Mat read (const Way &way) const;

private:
  GstGLContext *context_;
  GstGLMemory *memory_ = nullptr;
  GstGLFramebuffer *framebuffer_ = nullptr;
};

} // namespace bench
