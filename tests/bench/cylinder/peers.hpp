/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What else clears points that several views see. */
#pragma once

#include "frames.hpp"

namespace bench {

/** The published rule as one would first write it: vertical axis through the middle of all points,
 *  one slice after another, points of a view sorted by phi, units in a map; neither layers nor
 *  neighbours. */
void plain_rule (FrameSet &set);

/** One point a cube of 4 mm: the first that comes. */
void voxel_grid (FrameSet &set);

/** Of the views that see a point (their depth there is within 15 mm of its own), the one that sees
 *  it most frontally keeps it: normals from neighbouring pixels, no cylinder. What renderers with a
 *  large GPU do for each pixel of the screen. */
void frontal_camera (FrameSet &set);

} // namespace bench
