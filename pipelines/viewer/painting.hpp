/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is laid over the viewer's picture, as pixels. */
#pragma once

#include <gst/video/video.h>

#include <span>
#include <string>

struct PictureSize {
  int width = 0, height = 0; ///< pixels
  friend bool operator== (const PictureSize &, const PictureSize &) = default;
};

/** A line of text; with a key, in a column of its own before it. */
struct TextRow {
  std::string key, text; ///< UTF-8
  friend bool operator== (const TextRow &, const TextRow &) = default;
};

enum class TextPlace { kTop, kMiddle, kBottom };

/** Lines of text on a dark panel, smaller than usual where the picture is too small for them.
 *  Returns: (transfer full): nullptr if there is no room for it at all */
GstVideoOverlayRectangle *paint_text (
    std::span<const TextRow> rows, TextPlace place, double alpha, PictureSize picture);

/** Where the time bar is in a picture, pixels. */
struct TimeBarPlace {
  explicit TimeBarPlace (PictureSize picture);
  int top, height;   ///< of the panel, which is as wide as the picture
  double begin, end; ///< of the bar within
  double text_begin, font_size;
};

/** @param share  of the bar that lies behind the position, 0 to 1
 *  @param times  position and duration
 *  Returns: (transfer full): nullptr if there is no room for it */
GstVideoOverlayRectangle *paint_time_bar (
    double share, const std::string &times, PictureSize picture);
