/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <memory>
#include <span>

#include "rig_calibration.hpp"
#include "selection.hpp"
#include "still.hpp"

namespace rangecast {

struct SessionSettings {
  CalibrationSettings calibration;
  SelectionSettings selection;
  bool thorough = false; ///< see BoardDetector::set
};

/** A calibration in progress: examines images, keeps frames, calibrates. Not thread-safe. */
class CalibrationSession {
public:
  /** Restarts with new settings. @return kBadValue that names the setting */
  Status set (const SessionSettings &settings);
  /** Discards all frames. */
  void clear ();

  /** Looks for the board in all images of one moment, in parallel.
   *  @param cameras   the same in each call, or with more appended; otherwise all frames are
   * discarded
   *  @param images  by camera; empty if there is none
   *  @param time_ns   of the images
   *  @param number    the caller's number */
  Status examine (const std::vector<CalibrationCamera> &cameras,
      std::span<const ImageView<const Rgbx>> pictures, std::uint64_t time_ns, std::uint64_t number);

  /** @name Of the last images @{ */
  [[nodiscard]] FrameVerdict verdict () const { return verdict_; }
  [[nodiscard]] const std::vector<BoardCorner> &corners (int camera) const
  {
    return states_[camera]->corners;
  }
  /** @} */

  [[nodiscard]] const std::vector<CalibrationCamera> &cameras () const { return cameras_; }
  [[nodiscard]] int frames () const { return int (selector_.frames ().size ()); }
  [[nodiscard]] CameraCoverage coverage (int camera) const
  {
    return selector_.coverage (cameras_[camera], camera);
  }
  /** Connected components of the cameras that saw the same boards, by camera. */
  [[nodiscard]] std::vector<int> groups () const;
  /** Whether every camera has seen enough, and all are in one component. */
  [[nodiscard]] bool complete () const;

  /** Draws the images that examine() saw, one tile per camera. @param out  size as lay_out() says
   */
  void draw (std::span<const ImageView<const Rgbx>> pictures, ImageView<Rgbx> out) const;

  /** See calibrate_rig(). Frames are kept, so that more can be added. */
  Status calibrate (CalibrationResult &result, std::stop_token stop = {}) const;

private:
  struct CameraState {
    BoardDetector detector;
    std::vector<BoardCorner> corners;
    double edge_width = 0;
    Status status;
    std::array<int, kFrameVerdicts> seen{}; // images with a board so far, by verdict
  };
  [[nodiscard]] Status check_kept () const;

  SessionSettings settings_;
  std::vector<CalibrationCamera> cameras_;
  std::vector<std::unique_ptr<CameraState>> states_; // by camera
  FrameSelector selector_;
  FrameVerdict verdict_ = FrameVerdict::kNoBoard;
};

} // namespace rangecast
