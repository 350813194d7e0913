/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What the files of striprender share: gststriprender.cpp is the element, scheduling.cpp decides
 * which frame set is drawn when, frame.cpp draws one. */

#include <atomic>
#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <gstrange/gstrangeinfo.hpp>
#include <mutex>
#include <rangecast/surface/view_fit.hpp>

#include "common/elementproperties.hpp"
#include "opengl.hpp"
#include "picture.hpp"
#include "settings.hpp"

GST_DEBUG_CATEGORY_EXTERN (strip_render_debug);
#define GST_CAT_DEFAULT strip_render_debug

/** Of property `stats`. */
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
};

struct GstStripRenderPrivate {
  std::mutex lock; /* guards what follows; nothing is pushed, posted or queried with it */
  StripRenderSettings settings;
  RenderStats stats;

  /* From downstream's events: running time up to which pictures are late (QOS); ns (LATENCY). */
  std::atomic<GstClockTime> earliest = GST_CLOCK_TIME_NONE, pipeline_latency = 0;
  GstAggregatorPad *sink = nullptr;
  OpenGl gl;              /* has a lock of its own */
  StatsReporter reporter; /* has locks of its own */

  /* Of the aggregator's thread. */
  GstCaps *input = nullptr; /* the last ones that were accepted */
  gstrange::RangeInfo info; /* of these */
  GstVideoInfo out;
  GstClockTime period = 0;  /* ns from one picture to the next; 0: one per frame set */
  bool is_gl = false;       /* out is of OpenGL memory */
  bool lost_opengl = false; /* its context; no other one is made */
  std::unique_ptr<RenderBackend> backend;
  rangecast::SurfaceScene scene;
  rangecast::ViewFit fit;
  std::array<rangecast::RangeImage, rangecast::kMaxViews> visible; /* selected by view-mask */
  GstClockTime first_running = GST_CLOCK_TIME_NONE; /* of the first picture: auto-orbit's begin */

  /* Of the same, if the output has a frame rate of its own: stream positions. */
  GstBuffer *frame_set = nullptr;          /* the newest one */
  bool is_built = false;                   /* the scene has its strips */
  GstClockTime end = 0, slack = 0;         /* of the frame set; ends are not exact */
  GstClockTime next = GST_CLOCK_TIME_NONE; /* of the next picture */
  bool segment_sent = false;
  bool discont = true; /* there is no picture right before the next one */
};

DECLARE_ELEMENT (GstStripRender, gst_strip_render, STRIP_RENDER, GstAggregator)

/** @name scheduling.cpp: which frame set is drawn when. On the aggregator's thread @{ */
GstFlowReturn gst_strip_render_aggregate (GstAggregator *aggregator, gboolean timeout);
GstClockTime gst_strip_render_get_next_time (GstAggregator *aggregator);
/** Pushes the pictures that the newest frame set still has to show, and forgets it. */
void strip_drain (GstStripRender *self);
/** Forgets the stream. */
void strip_reset_stream (GstStripRender *self);

/** Running time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_running_time (GstStripRender *self, GstClockTime pts);
/** Stream time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_stream_time (GstStripRender *self, GstClockTime pts);
/** @} */

/** frame.cpp: draws a frame set into a buffer, as it is to be seen at that buffer's PTS. Posts
 *  errors. On the aggregator's thread.
 *  @param repeated  the last picture showed the same frame set: its strips are kept */
GstFlowReturn strip_draw_frame (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, bool repeated);
