/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "common/matcher.hpp"
#include "common/videoframereader.hpp"

#include <memory>
#include <optional>
#include <rangecast/calibration/session.hpp>
#include <vector>

/* From the sink pads of rigcalibrate to sets of images of one moment. */

G_BEGIN_DECLS

/* Sink pad of rigcalibrate, with the properties view and role. */
#define GST_TYPE_RIG_CALIBRATE_PAD (gst_rig_calibrate_pad_get_type ())
G_DECLARE_FINAL_TYPE (
    GstRigCalibratePad, gst_rig_calibrate_pad, GST, RIG_CALIBRATE_PAD, GstAggregatorPad)

G_END_DECLS

/** The pad's name, view and role, without the image size. Any thread. */
rangecast::CalibrationCamera calibration_camera (GstRigCalibratePad *pad);

/** One sink pad. */
struct CameraInput {
  GstRigCalibratePad *pad; /* reference */

  /* streaming thread */
  std::optional<GstVideoInfo> info;
  bool refused = false; /* its current caps; the error was posted */

  /* jobs */
  VideoFrameReader reader;
  std::optional<GstVideoInfo> reader_info;

  explicit CameraInput (GstRigCalibratePad *p) : pad (GST_RIG_CALIBRATE_PAD (gst_object_ref (p))) {}
  ~CameraInput () { gst_object_unref (pad); }
  CameraInput (const CameraInput &) = delete;
  CameraInput &operator= (const CameraInput &) = delete;
  [[nodiscard]] GstAggregatorPad *aggregator_pad () const { return GST_AGGREGATOR_PAD (pad); }
};
using CameraInputs = std::vector<std::shared_ptr<CameraInput>>;

/** Images of one moment on their way to the board detector; vectors are by camera. */
struct CalibrationImages {
  CameraInputs cameras;
  std::vector<rangecast::CalibrationCamera> described;
  std::vector<GstVideoInfo> infos;
  std::vector<GstBuffer *> buffers; /* references; null where there is none */
  GstClockTime capture = 0, running = GST_CLOCK_TIME_NONE;
  guint64 number = 0;
  std::optional<rangecast::SessionSettings> begin; /* in the first set: starts the session */
  bool auto_finish = false;

  CalibrationImages () = default;
  CalibrationImages (const CalibrationImages &) = delete;
  CalibrationImages &operator= (const CalibrationImages &) = delete;
  ~CalibrationImages ();
};

/** Maps the images of a set as long as it lives. */
class MappedImages {
public:
  explicit MappedImages (CalibrationImages &set);
  ~MappedImages ();
  MappedImages (const MappedImages &) = delete;
  MappedImages &operator= (const MappedImages &) = delete;

  std::vector<rangecast::ImageView<const rangecast::Rgbx>> views; ///< by camera
  rangecast::Status status;

private:
  void open (CalibrationImages &set, std::size_t i);

  std::vector<CameraInput *> open_;
};

/** What waits at every pad, by camera; times are of capture. An image that waits is required: its
 *  set has it, or it is dropped. */
struct CameraHeads {
  CameraHeads (const CameraInputs &cameras, GstClockTime tolerance, bool live);
  ~CameraHeads ();
  CameraHeads (const CameraHeads &) = delete;
  CameraHeads &operator= (const CameraHeads &) = delete;

  std::vector<PadStream> list;
  std::vector<MatchStream *> order; ///< for match_streams()
};

/** Maximum difference of the capture times of one set, ns: half a frame of the fastest camera, or
 *  5 ms. */
GstClockTime max_capture_skew (const CameraInputs &cameras);

/** Takes the images of a set off their pads. */
std::shared_ptr<CalibrationImages> pop_images (
    const CameraInputs &cameras, const CameraHeads &heads, guint64 number);
