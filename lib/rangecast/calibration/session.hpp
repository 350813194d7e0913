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

/** A calibration as it is done: pictures come in, frames are kept, in the end there is a rig.
 *  One thread at a time. */
class CalibrationSession {
public:
  /** Forgets everything. @return kBadValue that names the setting */
  Status set (const SessionSettings &settings);
  /** Forgets all frames. */
  void clear ();

  /** Looks for the board in the pictures of one moment, all of them at once.
   *  @param cameras   the same every time; more may come at the end. All frames are forgotten where
   *  one went or became another
   *  @param pictures  by camera; empty where there is none
   *  @param time_ns   of the pictures
   *  @param number    by which the caller knows them */
  Status examine (const std::vector<CalibrationCamera> &cameras,
      std::span<const ImageView<const Rgbx>> pictures, std::uint64_t time_ns, std::uint64_t number);

  /** @name Of the last pictures @{ */
  [[nodiscard]] FrameVerdict verdict () const { return verdict_; }
  [[nodiscard]] const std::vector<BoardCorner> &corners (int camera) const
  {
    return eyes_[camera]->corners;
  }
  /** @} */

  [[nodiscard]] const std::vector<CalibrationCamera> &cameras () const { return cameras_; }
  [[nodiscard]] int frames () const { return int (selector_.frames ().size ()); }
  [[nodiscard]] CameraCoverage coverage (int camera) const
  {
    return selector_.coverage (cameras_[camera], camera);
  }
  /** Which cameras see the same boards, directly or through others: numbers of groups by camera. */
  [[nodiscard]] std::vector<int> groups () const;
  /** Whether every camera has seen enough, and all of them hang together. */
  [[nodiscard]] bool complete () const;

  /** Draws what examine() saw, one tile a camera. @param out  of lay_out()'s size */
  void draw (std::span<const ImageView<const Rgbx>> pictures, ImageView<Rgbx> out) const;

  /** See calibrate_rig(). Frames stay: more may come, and make it better. */
  Status calibrate (CalibrationResult &result, std::stop_token stop = {}) const;

private:
  struct Eye {
    BoardDetector detector;
    std::vector<BoardCorner> corners;
    double edge_width = 0;
    Status status;
    std::array<int, kFrameVerdicts> seen{}; // pictures with a board so far, by verdict
  };
  [[nodiscard]] Status check_kept () const;

  SessionSettings settings_;
  std::vector<CalibrationCamera> cameras_;
  std::vector<std::unique_ptr<Eye>> eyes_; // by camera
  FrameSelector selector_;
  FrameVerdict verdict_ = FrameVerdict::kNoBoard;
};

} // namespace rangecast
