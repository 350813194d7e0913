/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "painting.hpp"

/** What the viewer lays over its pictures: the keys, a hint at the start, short messages, and the
 *  time bar of a file. Any thread; the time bar's mouse comes in the window's. */
class Overlay {
public:
  /** @param keys  what toggle_help() shows
   *  @param hint  that is shown at first, and fades */
  Overlay (std::vector<TextRow> keys, std::string hint);
  ~Overlay ();
  Overlay (const Overlay &) = delete;
  Overlay &operator= (const Overlay &) = delete;

  void toggle_help ();
  /** Shows the time bar for a moment, if there is one. */
  void show_bar ();
  /** Shows a line for a moment. */
  void say (std::string message);
  /** @param duration  ns; 0: no time bar */
  void set_duration (GstClockTime duration);

  /** @name The mouse, in pixels of the picture @{ */
  /** @return whether the time bar handled it, so that the event goes no further */
  bool press (int button, double x, double y);
  bool move (double x, double y);
  bool release (int button);
  /** @} */

  struct Drag {
    GstClockTime position; ///< ns
    bool released;
  };
  /** Where a hand has drawn the time bar to since the last call. */
  std::optional<Drag> next_drag ();

  /** What is to be laid over the sample's picture now; nullptr: nothing. (transfer full) */
  GstVideoOverlayComposition *draw (GstSample *sample);
  /** Whether the picture that was drawn last shows something else than one drawn now. */
  bool is_stale ();

private:
  /* All that pictures of the overlay depend on. */
  struct Shown {
    PictureSize size;
    bool help = false;
    std::string message;
    int hint_tenths = 0; /* of its alpha */
    bool bar = false;
    int bar_pixel = 0;
    std::string times;
    friend bool operator== (const Shown &, const Shown &) = default;
  };
  [[nodiscard]] Shown look (gint64 now) const;
  [[nodiscard]] bool is_on_bar (double y) const;
  [[nodiscard]] bool is_dragging () const;
  void set_drag (double x);

  const std::vector<TextRow> keys_;
  const std::string hint_;
  std::mutex lock_; /* guards what follows */
  bool help_ = false;
  std::string message_;
  gint64 message_until_ = 0, bar_until_ = 0, hint_until_ = 0; /* monotonic time, us */
  bool drawn_ = false;                                        /* the first picture */
  GstClockTime duration_ = 0, position_ = 0;                  /* stream time */
  unsigned pressed_ = 0; /* bit i: button i, which was pressed on the time bar */
  GstClockTime dragged_to_ = 0;
  std::optional<Drag> drag_;
  Shown shown_;
  GstVideoOverlayComposition *composition_ = nullptr; /* that shows it */
};

/** As players show times: m:ss, or h:mm:ss. */
std::string time_text (GstClockTime time);
