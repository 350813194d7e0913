/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "matchers.hpp"

namespace bench {

/** Renders a room of plain surfaces: a wall, a floor that slants away and boards before them, whose
 * texture is weaker than the noise, one of them overexposed. The right camera is 3 % brighter.
 *  @param size         pixels
 *  @param noise_sigma  of each colour, grey levels
 *  @param[out] pair    left, right and truth */
void render_plain (cv::Size size, double noise_sigma, Pair &pair);

} // namespace bench
