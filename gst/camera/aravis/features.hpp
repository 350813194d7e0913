/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "status.hpp"

/** One assignment of a features string. */
struct CameraFeature {
  std::string name;     ///< GenICam's, as "Gamma", "LineSelector"
  std::string value;    ///< as written, without quotes; empty only for commands
  bool command = false; ///< written without "=": executed

  bool operator== (const CameraFeature &) const = default;
};

/** Splits "Name=Value Name='two words' Command ..." at spaces, commas or semicolons; '"' and "'"
 *  quote values. Names are letters, digits, '_', and begin with a letter.
 *  @param[out] features  in order of the string; empty after a failure
 *  @return kBadSetting: the text shows the place and what was expected */
CameraStatus parse_camera_features (std::string_view text, std::vector<CameraFeature> &features);
