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

/** A picture of depth for people: 255 at near, falling linearly to 1 at far and beyond, 0 where
 *  depth is invalid and around the image.
 *  @param near, far  depth units, near < far
 *  @param[out] full  H x W of the view. Reentrant. */
void paste_depth_map (const ConstRangeImage &image, std::uint16_t near, std::uint16_t far,
    ImageView<std::uint8_t> full);

/** The same in colours of the Turbo map, from red at near to blue at far; black where depth is
 *  invalid. The colours follow the polynomials that A. Mikhailov fitted to the map (Google, 2019),
 *  which differ from it by 6 levels on average,
 *  and by up to 33 at the blue end. Reentrant. */
void paste_depth_map (
    const ConstRangeImage &image, std::uint16_t near, std::uint16_t far, ImageView<Rgbx> full);

/** Changes the byte order of 16-bit pixels.
 *  @param in       H x W
 *  @param[out] out H x W, may be `in`. Reentrant. */
void swap_bytes (ImageView<const std::uint16_t> in, ImageView<std::uint16_t> out);

} // namespace rangecast
