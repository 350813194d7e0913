/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "common/videoframereader.hpp"
#include "pad.hpp"

#include <memory>
#include <optional>
#include <rangecast/calibration/session.hpp>
#include <vector>

/* From the pads of rigcalibrate to the pictures of one moment. */

/* One sink pad, and what its caps said. */
struct CalibrationSource {
  GstRigCalibratePad *pad;
  GstVideoInfo info; /* streaming thread */
  bool has_info = false;
  bool refused = false; /* the caps that it has now; the error was posted */
  VideoFrameReader reader; /* jobs */
  GstVideoInfo reader_info;
  bool reader_set = false;

  explicit CalibrationSource (GstRigCalibratePad *p)
      : pad (GST_RIG_CALIBRATE_PAD (gst_object_ref (p))), info{}, reader_info{}
  {
  }
  ~CalibrationSource () { gst_object_unref (pad); }
  CalibrationSource (const CalibrationSource &) = delete;
  [[nodiscard]] GstAggregatorPad *aggregator_pad () const { return GST_AGGREGATOR_PAD (pad); }
};
using CalibrationSources = std::vector<std::shared_ptr<CalibrationSource>>;

/* Pictures of one moment on their way to the board detector. */
struct CalibrationPictures {
  CalibrationSources sources;
  std::vector<rangecast::CalibrationCamera> described;
  std::vector<GstVideoInfo> infos;
  std::vector<GstBuffer *> buffers; /* by source; null where there is none */
  GstClockTime capture = 0, running = GST_CLOCK_TIME_NONE;
  guint64 number = 0;
  std::optional<rangecast::SessionSettings> begin; /* with the first ones */
  int tile_width = 0;
  bool auto_finish = false;

  CalibrationPictures () = default;
  CalibrationPictures (const CalibrationPictures &) = delete;
  ~CalibrationPictures ();
};

/* The same as the core sees them; unmapped when it goes. */
class MappedCalibrationPictures {
public:
  explicit MappedCalibrationPictures (CalibrationPictures &pictures);
  ~MappedCalibrationPictures ();
  MappedCalibrationPictures (const MappedCalibrationPictures &) = delete;

  std::vector<rangecast::ImageView<const rangecast::Rgbx>> views;
  rangecast::Status status;

private:
  void open (CalibrationPictures &pictures, std::size_t i);

  std::vector<CalibrationSource *> open_;
};

/* The oldest picture of every pad; unrefs them when it goes. */
class CalibrationFronts {
public:
  struct Front {
    std::size_t source;
    GstBuffer *buffer; /* a reference of ours */
    GstClockTime capture, running;
  };

  CalibrationFronts (const CalibrationSources &sources, bool live);
  ~CalibrationFronts ();
  CalibrationFronts (const CalibrationFronts &) = delete;

  std::vector<Front> list;
  int missing = 0, ended = 0;
};

/* How far apart capture times of one moment may be: max_skew, or half a frame where that is 0. */
GstClockTime calibration_tolerance (const CalibrationSources &sources, GstClockTime max_skew);

/* Drops gaps, and pictures too old to be of the moment of the newest, and all while a camera has
 * not begun.
 * @param[out] dropped  counts the pictures among them
 * @return whether any went */
bool drop_unmatched (const CalibrationSources &sources, const CalibrationFronts &fronts,
    GstClockTime tolerance, guint64 &dropped);

/* Takes what waits on all pads. */
std::shared_ptr<CalibrationPictures> take_pictures (
    const CalibrationSources &sources, const CalibrationFronts &fronts, guint64 number);
