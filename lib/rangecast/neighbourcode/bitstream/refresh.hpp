/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../../geometry/range_image.hpp"

namespace rangecast {

/** Some rows of a ROI, coded independently of other rows. */
struct RowBand {
  int first_row = 0, rows = 0; ///< of the ROI
  bool key = true;             ///< without reference to an earlier frame set
  std::size_t index = 0;       ///< of the band, from the top of the view's full image
  std::uint64_t refreshed = 0; ///< when it was last coded as key by the schedule; grows
};

/** Rolling intra refresh of one view. Its full image is cut into bands of rows; each is coded
 *  without reference to earlier frame sets at least once in a period, one after the other from the
 *  bottom to the top (see ReferenceChoice::sort()). Pixels refer to pixels of their own band only,
 * so the damage of a lost packet is repaired when its band is refreshed: after a period at most,
 * plus a frame interval if intervals grow. */
class RefreshSchedule {
public:
  struct Time {
    std::uint64_t now_ns;      ///< of the frame set
    std::uint64_t interval_ns; ///< between frame sets, used where times do not grow
    std::uint64_t period_ns;   ///< 0: no refresh
  };

  /** Rows of a band: about a quarter of the image, whole blocks of motion, and not so few that
   * slices become small. */
  [[nodiscard]] int band_rows () const { return band_rows_; }
  /** Bands of the image. */
  [[nodiscard]] std::size_t bands () const { return age_ns_.size (); }

  /** @param view_id  spreads the bands of several views over time */
  void reset (int view_height, int view_id);

  /** Plans how the bands of a ROI are coded.
   *  @param key  all without reference
   *  @param[out] bands  those in the ROI, from top to bottom */
  void plan (const Roi &roi, const Time &time, bool key, std::vector<RowBand> &bands);

private:
  std::vector<std::uint64_t> age_ns_;    /* of each band, since it was refreshed */
  std::vector<std::uint64_t> refreshed_; /* frame sets, counted from 1 */
  std::uint64_t last_time_ns_ = 0, count_ = 0;
  int view_id_ = 0, band_rows_ = 1;
};

} // namespace rangecast
