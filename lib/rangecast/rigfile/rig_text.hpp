/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

#include "../geometry/rig.hpp"

namespace rangecast {

/** Of the layout that docs/formats/rig.md describes. */
inline constexpr int kRigFileVersion = 1;

/** The file form of a valid rig, as cv::FileStorage of OpenCV 4.6 writes it. */
std::string rig_text (const Rig &rig, bool json);

} // namespace rangecast
