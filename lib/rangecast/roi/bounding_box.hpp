/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Bounding box of all valid pixels, in full-image pixels, with a margin but within the image's
 * ROI. Empty if no pixel is valid. */
Roi bounding_box (const ConstRangeImage &image, int margin);

} // namespace rangecast
