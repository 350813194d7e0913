/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <span>
#include <string>

/** striprender's property `stats`. */
struct RenderStats {
  /* since start */
  guint64 frames = 0;         ///< pictures drawn
  guint64 frame_sets = 0;     ///< received
  guint64 repeated = 0;       ///< pictures of a frame set that an earlier one showed
  guint64 dropped = 0;        ///< pictures not drawn because they would have been late
  guint64 uploaded_total = 0; ///< bytes
  guint64 points_total = 0;   ///< drawn
  const char *backend = "";   ///< that draws
  /* of the last picture */
  guint64 points = 0, vertices = 0, triangles = 0, strips = 0, isolated = 0, uploaded_bytes = 0;

  /** Returns: (transfer full) */
  [[nodiscard]] GstStructure *to_structure () const;
};

/** Statistics as lines of text, updated twice a second to be legible. */
class StatsText {
public:
  /** @param views    of the last frame set
   *  @param latency  ns from the frame set's time to its drawing; GST_CLOCK_TIME_NONE: unknown
   *  @param now_us   any clock, microseconds
   *  @return whether the lines have changed */
  bool update (const RenderStats &stats, std::size_t views, GstClockTime latency, gint64 now_us);
  [[nodiscard]] std::span<const std::string> lines () const { return lines_; }

private:
  std::array<std::string, 5> lines_;
  RenderStats last_;
  gint64 last_us_ = -1;
};
