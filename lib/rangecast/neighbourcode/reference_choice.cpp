/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "reference_choice.hpp"

#include <algorithm>

namespace rangecast {
namespace {

/* A reference that does not pay is tried again after 1, 2, 4... frame sets, up to this many: about
 * a second at 30 frame sets a second. */
constexpr int kMaxWait = 32;

/* A reference is doubtful from this share of the key size on: key bands are coded finer than the
 * thresholds ask, and would be smaller otherwise. */
constexpr double kDoubt = 0.85;

/* Slices may cross bands that touch and are coded alike, unless the lower one was refreshed after
 * the upper one: pixels depend on those above, so damage that is older than the lower band would
 * enter it again. */
void
append (const RowBand &band, std::vector<RowBand> &to)
{
  RowBand *const above = to.empty () ? nullptr : &to.back ();
  if (above && above->first_row + above->rows == band.first_row && above->key == band.key &&
      above->refreshed >= band.refreshed) {
    above->rows += band.rows;
    above->refreshed = band.refreshed;
  } else {
    to.push_back (band);
  }
}

} // namespace

void
ReferenceChoice::sort (std::span<const RowBand> bands, std::vector<RowBand> &fine,
    std::vector<RowBand> &coarse, std::vector<RowBand> &both)
{
  fine.clear ();
  coarse.clear ();
  both.clear ();
  bool has_tried = false; /* one retry a frame set, which bounds its time */
  for (const RowBand &band : bands) {
    Band &known = bands_[band.index];
    known.waited = std::min (known.waited + 1, kMaxWait);
    const bool is_due = known.waited >= known.wait && !has_tried;
    const bool may_try = known.state == State::kUnknown ||
                         (is_due && (known.state == State::kPaysNot || known.is_doubtful));
    if (!band.key && may_try) {
      has_tried = has_tried || known.state != State::kUnknown;
      both.push_back (band);
    } else if (known.state != State::kPaysNot) {
      append (band, fine);
    } else {
      append ({band.first_row, band.rows, true, band.index, 0}, coarse);
    }
  }
}

bool
ReferenceChoice::expects_delta (const RowBand &band) const
{
  return bands_[band.index].state != State::kPaysNot;
}

void
ReferenceChoice::record_trial (const RowBand &band, std::size_t delta_bytes, const Cost &key)
{
  Band &known = bands_[band.index];
  const bool pays = delta_bytes < key.bytes;
  const State state = pays ? State::kPays : State::kPaysNot;
  const bool is_new = pays && known.state == State::kPaysNot;
  known.wait = state == known.state ? std::min (2 * known.wait, kMaxWait) : 1;
  known.state = state;
  known.waited = 0;
  known.key_bytes = double (key.bytes) / double (std::max<std::size_t> (key.pixels, 1));
  known.is_doubtful = false;
  if (is_new) /* probably it pays in others, too */
    for (Band &other : bands_)
      other.wait = 1;
}

void
ReferenceChoice::record_coded (const RowBand &band, const Cost &cost)
{
  Band &known = bands_[band.index];
  const double bytes = double (cost.bytes) / double (std::max<std::size_t> (cost.pixels, 1));
  if (band.key)
    known.key_bytes = bytes;
  known.is_doubtful = !band.key && bytes > kDoubt * known.key_bytes;
}

} // namespace rangecast
