/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "rig.hpp"

namespace rangecast {

/** Whether a stereo pair needs no rectification: no distortion, no rotation, one focal length, and
 *  a displacement along x alone. @param view  has a right camera */
bool is_rectified (const View &view);

/** What is wrong with how a stereo pair stands, or empty: axes that converge, or one camera ahead
 *  of the other. Rectification must then turn images so far that it stretches them, loses what the
 *  cameras see in common, and enlarges errors of rows. @param view  has a right camera */
std::string describe_misalignment (const View &view);

/** Rotation of the left camera of a stereo pair that makes its rows agree with those of the right.
 *  Method: J.-Y. Bouguet's, as in cv::stereoRectify: each camera turns by half of the rotation
 *  between them, then both turn so that the baseline lies along x.
 *  @param partner_from_left  pose of the pair, cameras beside each other
 *  @return rectified_from_left */
Mat3 rectifying_rotation (const Pose &partner_from_left);

} // namespace rangecast
