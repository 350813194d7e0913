/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <optional>

/** Position, pause and seeks of the viewer's pipeline. One seek is under way at a time: of those
 *  that are asked for meanwhile the last one follows. Main thread. */
class Playback {
public:
  /** @param seekable  a file: it can be paused and sought in */
  Playback (GstElement *pipeline, bool seekable) : pipeline_ (pipeline), seekable_ (seekable) {}

  [[nodiscard]] bool is_paused () const { return paused_; }
  /** ns; 0 if it is not known */
  [[nodiscard]] GstClockTime duration () const;
  /** Of the frame that is shown, or will be after the seeks; ns. */
  [[nodiscard]] GstClockTime position () const;

  void toggle_pause ();
  /** @param position  ns; kept within the file
   *  @param accurate  the frame set at that time; else the key frame set before it, which is faster
   *  @return false if the pipeline cannot seek */
  bool seek (GstClockTime position, bool accurate);
  /** Pauses, and shows the frame set before or after the one that is shown. */
  void step (bool forward, GstClockTime frame_duration);
  /** While a file is paused nothing is drawn. So that the view can be turned all the same, the file
   *  is sought to where it is: the frame set there comes again. */
  void redraw_if_paused ();
  /** Of ASYNC_DONE: the seek is over. */
  void seek_done ();

private:
  struct Target {
    GstClockTime position;
    bool accurate;
  };
  bool start (const Target &target);

  GstElement *pipeline_;
  bool seekable_;
  bool paused_ = false, seeking_ = false, redraw_ = false;
  GstClockTime under_way_ = 0; /* the position that is sought to */
  std::optional<Target> next_;
};
