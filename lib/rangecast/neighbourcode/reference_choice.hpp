/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "bitstream/refresh.hpp"

namespace rangecast {

/** Finds, for each band of a view, whether slices with a reference are smaller than those without;
 *  where a camera moves they are not. Bands for which a reference pays are coded with it, until
 *  their size comes near what they took when last refreshed. Bands for which it does not pay are
 *  coded without, and both ways now and then. Results do not depend on time or threads. */
class ReferenceChoice {
public:
  /** Size of a coded band. */
  struct Cost {
    std::size_t bytes = 0, pixels = 0; ///< pixels: of the ROI in the band
  };

  /** Forgets all bands. @param bands  number of bands of the view's full image */
  void reset (std::size_t bands) { bands_.assign (bands, {}); }

  /** Sorts the bands of a frame set. Clears the lists first.
   *  @param bands  as the refresh schedule wants them
   *  @param[out] fine  those for which a reference pays: as the schedule wants them; those that
   *  touch and are coded alike are made one
   *  @param[out] coarse  to be coded without reference, and no finer than need be, as later frame
   *  sets will hardly take their pixels; those that touch are made one
   *  @param[out] both  to be coded both ways, of which the smaller one counts: see record_trial()
   */
  void sort (std::span<const RowBand> bands, std::vector<RowBand> &fine,
      std::vector<RowBand> &coarse, std::vector<RowBand> &both);

  /** Whether a reference is expected to pay in a band that is coded both ways. */
  [[nodiscard]] bool expects_delta (const RowBand &band) const;
  /** A band was coded both ways. */
  void record_trial (const RowBand &band, std::size_t delta_bytes, const Cost &key);
  /** A band was coded as sort() had it in `fine`. */
  void record_coded (const RowBand &band, const Cost &cost);

private:
  enum class State : std::uint8_t { kUnknown, kPays, kPaysNot };
  struct Band {
    State state = State::kUnknown;
    double key_bytes = 0;     /* a pixel, when last coded without reference; 0 = not known */
    bool is_doubtful = false; /* a reference may no longer pay */
    int waited = 0, wait = 1; /* frame sets since the last trial, and until the next */
  };
  std::vector<Band> bands_;
};

} // namespace rangecast
