/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/range_image.hpp"

namespace rangecast {

/** The smallest box, in full-image pixels, that holds all valid pixels of an image, grown by a
 *  margin but not beyond the image's ROI. Empty if nothing is valid. */
Roi bounding_box (const ConstRangeImage &image, int margin);

} // namespace rangecast
