/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "refresh.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {

void
RefreshSchedule::reset (int view_height, int view_id)
{
  constexpr int kMin = 64, kBands = 4, kMultiple = 16;
  const int quarter = (view_height + kBands - 1) / kBands;
  band_rows_ = std::max (kMin, (quarter + kMultiple - 1) / kMultiple * kMultiple);
  age_ns_.assign (static_cast<std::size_t> ((view_height + band_rows_ - 1) / band_rows_), 0);
  refreshed_.assign (age_ns_.size (), 0);
  last_time_ns_ = count_ = 0;
  view_id_ = view_id;
}

void
RefreshSchedule::plan (const Roi &roi, const Time &time, bool key, std::vector<RowBand> &bands)
{
  const std::uint64_t period_ns = time.period_ns;
  bands.clear ();
  const std::uint64_t elapsed =
      time.now_ns > last_time_ns_ ? time.now_ns - last_time_ns_ : time.interval_ns;
  last_time_ns_ = time.now_ns;
  const std::size_t count = age_ns_.size ();
  count_++;
  for (std::size_t i = 0; i < count; i++) {
    std::uint64_t &age = age_ns_[i];
    age += elapsed;
    /* A band must not be older than the period at the next frame set. */
    const bool refresh = key || (period_ns > 0 && age + elapsed > period_ns);
    if (key) {
      /* All bands are fresh now. The next refreshes of all views are spread evenly over the period:
       * views are offset by the golden section, which works for any number of views. */
      const double place = double (i) / double (count) + view_id_ * 0.6180339887498949;
      age = static_cast<std::uint64_t> ((place - std::floor (place)) * double (period_ns));
    } else if (refresh) {
      age = 0;
    }
    const int top = std::max (int (i) * band_rows_, roi.y) - roi.y;
    const int bottom = std::min ((int (i) + 1) * band_rows_, roi.y + roi.height) - roi.y;
    if (refresh)
      refreshed_[i] = count_;
    if (top < bottom)
      bands.push_back ({top, bottom - top, refresh, i, refreshed_[i]});
  }
}

} // namespace rangecast
