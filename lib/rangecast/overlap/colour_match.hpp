/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "colour_balance.hpp"
#include "colour_blend.hpp"

namespace rangecast {

struct ColourSettings {
  bool balance = true;      ///< ColourBalance
  double blend_width_m = 0; ///< ColourBlend, metres, 0 .. 1; 0 = no blending
  int threads = 1;          ///< views at a time; 0 = number of cores
};

/** Colour correction before and after overlaps are cleared: before() balances the views by their
 *  overlaps, after() blends the seams. */
class ColourMatch {
public:
  /** Sets the cameras and resets all gains. */
  Status set_rig (const Rig &rig)
  {
    const Status status = balance_.set_rig (rig);
    return status.ok () ? blend_.set_rig (rig) : status;
  }
  /** Sets other poses; gains are kept. */
  Status change_rig (const Rig &rig)
  {
    const Status status = balance_.change_rig (rig);
    return status.ok () ? blend_.set_rig (rig) : status;
  }
  void reset () { balance_.reset (); }

  Status before (std::span<const RangeImage> images, const ColourSettings &settings)
  {
    if (settings.balance)
      if (Status status = balance_.process (images, settings.threads); !status.ok ())
        return status;
    return settings.blend_width_m > 0 ? blend_.remember (images) : Status{};
  }
  Status after (std::span<const RangeImage> images, const ColourSettings &settings)
  {
    return settings.blend_width_m > 0
               ? blend_.blend (images, settings.blend_width_m, settings.threads)
               : Status{};
  }

  [[nodiscard]] const ColourBalance &balance () const { return balance_; }

private:
  ColourBalance balance_;
  ColourBlend blend_;
};

} // namespace rangecast
