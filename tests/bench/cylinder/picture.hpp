/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

#include "frames.hpp"

namespace bench {

/** Draws a slice 8 mm high from above, each point in its view's colour: the set as it was on the
 *  left, as it is on the right; below, a part of both four times as large.
 *  @param y      height of the slice, metres
 *  @param path   a picture file
 *  @return kBadValue if it cannot be written, or if there is no point in the slice */
rangecast::Status draw_slice (FrameSet &set, double y, const std::string &path);

} // namespace bench
