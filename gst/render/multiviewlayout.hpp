/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <array>
#include <span>

/** Where the picture of one eye lies in an output buffer. */
struct EyeViewport {
  double side = 0;           ///< of the camera: -1 left, 1 right, 0 neither
  guint memory = 0;          ///< number of the buffer's memory
  int x = 0, y = 0;          ///< pixels of that memory's picture
  int width = 0, height = 0; ///< pixels
  double aspect = 1;         ///< width / height as displayed
};

/** One or two eyes' pictures, from multiview-mode and multiview-flags of the caps. */
class MultiviewLayout {
public:
  MultiviewLayout () = default;
  explicit MultiviewLayout (const GstVideoInfo &info);
  [[nodiscard]] std::span<const EyeViewport> eyes () const { return {eyes_.data (), count_}; }

private:
  std::array<EyeViewport, 2> eyes_;
  std::size_t count_ = 0;
};

/** Supported values of multiview-mode, for caps. */
#define STRIP_MULTIVIEW_MODES "{ mono, left, right, side-by-side, top-bottom, separated }"
