/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What the files of striprender share: gststriprender.cpp is the element, scheduling.cpp decides
 * when which frame set is drawn and has the locking order, frame.cpp draws one. */

#include <gst/gl/gl.h>
#include <gst/video/video.h>

#include <gstrange/gstrangeinfo.hpp>
#include <mutex>
#include <rangecast/overlay/stats_panel.hpp>
#include <rangecast/surface/view_fit.hpp>

#include "category.hpp"
#include "common/statsreporter.hpp"
#include "gststriprender.h"
#include "outputschedule.hpp"
#include "outputtask.hpp"
#include "renderer.hpp"
#include "scene.hpp"
#include "settings.hpp"
#include "stats.hpp"

/** A part of the stream without frame sets. */
struct StreamGap {
  GstClockTime begin = 0, end = 0; /* stream position; equal: there is none */
  GstGapFlags flags = GstGapFlags (0);
};

struct GstStripRenderPrivate {
  std::mutex lock; /* guards what follows; the last of the locks, see scheduling.cpp */
  StripRenderSettings settings;
  RenderStats stats;
  FrameRate rate;                              /* of the output's caps */
  OutputSchedule schedule;                     /* active: the output has a rate of its own */
  GstClockTime earliest = GST_CLOCK_TIME_NONE; /* running time up to which pictures are late */
  GstClockTime upstream_latency = 0;
  GstClockTime pipeline_latency = 0;     /* from the LATENCY event */
  GstClockTime overrun = 0;              /* latency for drawing that takes longer than a period */
  int slow_pictures = 0;                 /* the last ones that took longer than that */
  GstFlowReturn task_flow = GST_FLOW_OK; /* of the output task's last push */
  bool discont = false;                  /* pictures before the next one were dropped */

  /* Written with both stream locks, read with either. */
  GstCaps *input = nullptr; /* the last ones that were accepted */
  gstrange::RangeInfo info; /* of these */
  GstVideoInfo out;
  bool live = false, live_known = false;

  /* Of drawing: with the source pad's stream lock, or on the streaming thread if that draws;
   * or on the OpenGL thread while that thread waits for it. */
  StripScene scene;
  GstBuffer *drawn = nullptr; /* whose strips the scene has, if it may be drawn again */
  rangecast::ViewFit fit;
  std::array<rangecast::RangeImage, rangecast::kMaxViews> visible; /* selected by view-mask */
  Renderer renderer;
  StatsText stats_text;
  rangecast::StatsPanel stats_panel;
  GstClockTime first_running = GST_CLOCK_TIME_NONE; /* of the first picture: auto-orbit's begin */
  GError *gl_error = nullptr;                       /* why OpenGL cannot be used */
  GError *output_error = nullptr;                   /* why pictures of that size cannot be drawn */
  bool no_context = false;
  bool gl_error_posted = false; /* negotiation is tried again, the error is not posted again */
  StreamGap gap;                /* to be sent between pictures, as far as these do not fill it */

  OutputTask task;
  StatsReporter reporter; /* has locks of its own */
};

struct _GstStripRender {
  GstGLBaseFilter parent;
  GstStripRenderPrivate *priv;
};

/** @name scheduling.cpp: GstBaseTransform's functions, which decide when a frame set is drawn @{ */
GstFlowReturn gst_strip_render_submit_input_buffer (
    GstBaseTransform *base, gboolean is_discont, GstBuffer *in);
GstFlowReturn gst_strip_render_generate_output (GstBaseTransform *base, GstBuffer **out);
gboolean gst_strip_render_sink_event (GstBaseTransform *base, GstEvent *event);
gboolean gst_strip_render_query (
    GstBaseTransform *base, GstPadDirection direction, GstQuery *query);
/** A QOS or LATENCY event from downstream. Any thread. */
void strip_handle_timing_event (GstStripRender *self, GstEvent *event);

/** Selects one picture per frame set or a frame rate of its own, from caps and properties. With
 *  both stream locks. */
void strip_select_mode (GstStripRender *self);
/** Forgets the stream. With both stream locks, or while stopped. */
void strip_reset_stream (GstStripRender *self);

/** Running time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_running_time (GstStripRender *self, GstClockTime pts);
/** Stream time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_stream_time (GstStripRender *self, GstClockTime pts);
/** The clock's running time, or GST_CLOCK_TIME_NONE without a clock. Any thread. */
GstClockTime strip_running_now (GstStripRender *self);
/** @} */

/** frame.cpp: draws a frame set into a buffer, as it is to be seen at that buffer's PTS. Posts
 *  errors. With the source pad's stream lock, or on the streaming thread if that draws.
 *  @param keep  more pictures may be drawn of it: its strips stay */
GstFlowReturn strip_draw_frame (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, bool keep);
