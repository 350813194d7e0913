/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What the files of striprender share: gststriprender.cpp is the element, stripframe.cpp draws a
 * frame set, striprate.cpp gives the output a frame rate of its own. */

/* Locks, in the order in which they are taken:
 * - the sink pad's stream lock, as everywhere;
 * - the source pad's stream lock: whoever draws and pushes has it, if that is not the sink pad's
 *   streaming thread alone; so it is held for each serialized event and query, and by the thread
 *   that draws live pictures at the output's rate. That thread gives up the sink pad's before it
 *   draws, so that frame sets come in meanwhile;
 * - GstStripRenderPrivate::lock: settings, statistics, and the grid of pictures; never held across
 * a push, event, query or message. */

#include <gst/gl/gl.h>
#include <gst/video/video.h>

#include <gstrange/gstrangeinfo.hpp>
#include <mutex>
#include <rangecast/overlay/stats_panel.hpp>

#include "common/statsreporter.hpp"
#include "drawing.hpp"
#include "gststriprender.h"
#include "outputschedule.hpp"
#include "outputthread.hpp"
#include "scene.hpp"
#include "settings.hpp"
#include "stats.hpp"
#include "viewfit.hpp"

/** A stretch of the stream without frame sets. */
struct StreamGap {
  GstClockTime begin = 0, end = 0; /* stream position; end == begin: there is none */
  GstGapFlags flags = GstGapFlags (0);
};

struct GstStripRenderPrivate {
  std::mutex lock; /* guards what follows */
  StripRenderSettings settings;
  RenderStats stats;
  FrameRate rate;                              /* of the output's caps */
  PictureGrid grid;                            /* active: the output has a rate of its own */
  GstClockTime earliest = GST_CLOCK_TIME_NONE; /* running time; what is before it would be late */
  GstClockTime latency = 0;                    /* of upstream */
  GstClockTime pipeline_latency = 0;           /* as the LATENCY event tells */
  GstClockTime overdraw = 0; /* latency that is told because drawing takes longer than a period */
  int slow_pictures = 0;     /* the last ones, that took longer than was told */
  GstFlowReturn flow = GST_FLOW_OK; /* of the drawing thread's last push */
  bool discont = false;             /* pictures before the next one were left out */

  /* written with both stream locks, read with either */
  GstCaps *input = nullptr; /* the last ones that were not refused */
  gstrange::RangeInfo info; /* of these */
  GstVideoInfo out;
  bool live = false, live_known = false;
  bool caps_refused = false; /* the last ones, with an error */

  /* with the source pad's stream lock, or on the streaming thread where that one draws; or in the
   * GL thread while whoever has them waits for it */
  StripScene scene;
  GstBuffer *drawn = nullptr; /* whose strips the scene has, if it may be drawn again */
  ViewFit fit;
  std::array<rangecast::RangeImage, rangecast::kMaxViews>
      visible; /* of the frame set, by view-mask */
  StripDrawing drawing;
  StatsText stats_text;
  rangecast::StatsPanel stats_panel;
  GstClockTime first_running = GST_CLOCK_TIME_NONE; /* of the first frame: where auto-orbit began */
  GError *gl_error = nullptr;                       /* why OpenGL cannot be used */
  GError *output_error = nullptr;                   /* why it cannot have pictures of that size */
  bool no_context = false;
  bool gl_error_posted = false; /* negotiation is tried again, the error is not */
  StreamGap gap; /* to go downstream between pictures, as far as they do not fill it */

  PictureThread thread;
  StatsReporter reporter; /* has locks of its own */
};

struct _GstStripRender {
  GstGLBaseFilter parent;
  GstStripRenderPrivate *priv;
};

/** Both stream locks at once, in their order. */
class StreamLocks {
public:
  explicit StreamLocks (GstBaseTransform *base) : base_ (base)
  {
    GST_PAD_STREAM_LOCK (base_->sinkpad);
    GST_PAD_STREAM_LOCK (base_->srcpad);
  }
  ~StreamLocks ()
  {
    GST_PAD_STREAM_UNLOCK (base_->srcpad);
    if (has_sink_)
      GST_PAD_STREAM_UNLOCK (base_->sinkpad);
  }
  StreamLocks (const StreamLocks &) = delete;
  StreamLocks &operator= (const StreamLocks &) = delete;
  void give_up_sink ()
  {
    GST_PAD_STREAM_UNLOCK (base_->sinkpad);
    has_sink_ = false;
  }

private:
  GstBaseTransform *base_;
  bool has_sink_ = true;
};

/** @name stripguard.cpp @{ */

/** In a handler of all exceptions: posts the element's error for the one at hand.
 *  @return GST_FLOW_ERROR */
GstFlowReturn strip_flow_of_exception (GstStripRender *self);

/** Does what may throw, where C has called. @return what `work` returns; GST_FLOW_ERROR after an
 *  exception, which has been posted. Call without a lock but those of streams. */
template <typename Work>
GstFlowReturn
strip_guarded (GstStripRender *self, const Work &work)
{
  try {
    return work ();
  } catch (...) {
    return strip_flow_of_exception (self);
  }
}
/** @} */

/** @name stripframe.cpp: with the source pad's stream lock, or on the streaming thread @{ */

/** Running time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_running_time (GstStripRender *self, GstClockTime pts);
/** Stream time of a stream position, or GST_CLOCK_TIME_NONE outside of the segment. */
GstClockTime strip_stream_time (GstStripRender *self, GstClockTime pts);
/** Running time of the clock, or GST_CLOCK_TIME_NONE without a clock. Any thread. */
GstClockTime strip_running_now (GstStripRender *self);
/** Gives controlled properties their values of that stream position. One outside the segment, as of
 *  the first frame set after a seek to between two of them, is no stream time: values stay. */
void strip_sync_values (GstStripRender *self, GstClockTime pts);
/** Draws a frame set as it is to be seen at `running`. Posts what goes wrong.
 *  @param keep  more pictures may be drawn of it: what was made of it stays */
GstFlowReturn strip_draw_frame (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, GstClockTime running, bool keep);
/** @} */

/** @name striprate.cpp, late pictures @{ */

void strip_take_qos (GstStripRender *self, GstEvent *event);
/** Whether a picture of that running time would come too late, as far as QoS events tell. */
bool strip_is_late (GstStripRender *self, GstClockTime running);
/** Counts pictures that are not drawn because they would be late, and tells the application of the
 *  last one. */
void strip_drop_pictures (GstStripRender *self, guint64 count, GstClockTime pts,
    GstClockTime duration, GstClockTime running);
/** Flags the next picture that is drawn after such ones. */
void strip_mark_discont (GstStripRender *self, GstBuffer *out);
/** @} */

/** @name striprate.cpp, an output with a frame rate of its own @{ */

/** Times that go backwards, or are no times, have none. With either stream lock. */
bool strip_has_own_rate (GstStripRender *self);
/** Has pictures at the output's frame rate, or with the frame sets, as caps and properties say.
 *  With both stream locks. */
void strip_apply_rate (GstStripRender *self);
/** Asks upstream, once. On the streaming thread. */
void strip_learn_whether_live (GstStripRender *self);
/** For later pictures. @param in  transfer full */
GstFlowReturn strip_hand_to_grid (GstStripRender *self, GstBuffer *in);
/** For a picture that is not of the grid: its time is the grid's last from now on.
 *  @return false if it is before that, as when downstream has just given up a rate of its own */
bool strip_follows_grid (GstStripRender *self, GstClockTime pts);
/** Draws the next picture whose frame set is sure, now that none before `until` (stream position)
 *  can come, if it is in time. @return GST_FLOW_OK without a buffer if there is none */
GstFlowReturn strip_draw_next (GstStripRender *self, GstClockTime until, GstBuffer **out);
/** Draws and pushes what frame sets there are, and forgets them. With both stream locks. */
void strip_drain_and_reset (GstStripRender *self);
/** The same, and the stream goes on: pictures to come are later than those that went. */
void strip_drain (GstStripRender *self);
/** Fills a gap of the stream with pictures of what is held, and has the rest of it go downstream in
 *  its turn. With both stream locks.
 *  @return false if there is nothing to fill it with: the event itself is to go on */
bool strip_take_gap (GstStripRender *self, GstEvent *event);
/** Has copies of all frame sets that are held in place of those that came in, so that whoever owns
 *  their memory has it back. With both stream locks. */
void strip_give_back (GstStripRender *self);
/** Forgets the stream. With both stream locks, or stopped. */
void strip_reset_rate (GstStripRender *self);
/** Of a LATENCY event. Any thread. */
void strip_take_latency (GstStripRender *self, GstEvent *event);
/** Of a LATENCY query. Any thread. */
gboolean strip_answer_latency (GstStripRender *self, GstQuery *query);
/** @} */
