/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rig.hpp"

namespace rangecast {

/** Writes range images as a binary glTF 2.0 file: a vertex for each valid pixel (world, metres, y
 * up, colour in linear light as glTF has it), triangles of neighbours on one surface, and a
 * material without lighting. Without triangles it is a point cloud, without pixels an empty scene.
 *  @param images  each with its camera in `rig`
 *  @param[out] out  the file; replaced
 *  @return kNotFound if the rig lacks a view, kBadSize if the file would exceed 4 GiB. Reentrant.
 */
Status write_glb (
    std::span<const RangeImage> images, const Rig &rig, std::vector<std::uint8_t> &out);

} // namespace rangecast
