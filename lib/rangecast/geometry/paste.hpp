/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "range_image.hpp"

namespace rangecast {

/** Copies a range image's depth to its place in the view's full picture; 0 around it.
 *  @param image      its ROI is clipped to the full picture
 *  @param[out] full  H x W of the view, depth units. Reentrant. */
void paste_depth (const ConstRangeImage &image, ImageView<std::uint16_t> full);

/** The same with colour, black around it.
 *  @param only_valid  black, too, where depth is invalid. Reentrant. */
void paste_colour (const ConstRangeImage &image, bool only_valid, ImageView<Rgbx> full);

} // namespace rangecast
