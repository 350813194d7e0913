/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

namespace rangecast {

/** "640x480", for error messages. Sizes in pixels. */
inline std::string
size_text (int width, int height)
{
  return std::to_string (width) + "x" + std::to_string (height);
}

} // namespace rangecast
