/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What else clears points that several views see. */
#pragma once

#include "frames.hpp"

namespace bench {

/** The published rule as one would first write it: vertical axis through the middle of all points,
 *  one slice after another, points of a view sorted by phi, cells in a map; neither layers nor
 *  neighbours. */
void plain_rule (FrameSet &set);

/** One point a cube of 4 mm: the first that comes. */
void voxel_grid (FrameSet &set);

} // namespace bench
