/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <array>
#include <span>

/** The picture of one eye within an output buffer. */
struct EyePlace {
  double side = 0;           ///< of the camera: -1 left, 1 right, 0 neither
  guint memory = 0;          ///< number of the buffer's memory
  int x = 0, y = 0;          ///< pixels of that memory's picture
  int width = 0, height = 0; ///< pixels
  double aspect = 1;         ///< width / height as it is to be seen
};

/** One or two eyes' pictures, as the caps' multiview-mode and multiview-flags tell. */
class EyePlaces {
public:
  EyePlaces () = default;
  explicit EyePlaces (const GstVideoInfo &info);
  [[nodiscard]] std::span<const EyePlace> all () const { return {places_.data (), count_}; }

private:
  std::array<EyePlace, 2> places_;
  std::size_t count_ = 0;
};

/** What multiview-mode may be, for caps. */
#define STRIP_MULTIVIEW_MODES "{ mono, left, right, side-by-side, top-bottom, separated }"
