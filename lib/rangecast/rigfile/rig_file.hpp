/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <string_view>

#include "../base/output_path.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Extensions of rig files; see check_output_path(). */
inline constexpr std::string_view kRigExtensions[] = {".yml", ".yaml", ".json"};

/** Greatest size of a rig file, bytes: many times that of 64 views with three cameras. */
inline constexpr std::uintmax_t kMaxRigFileSize = std::uintmax_t{4} << 20;

/** Reads a rig from a file that cv::FileStorage opens, too: YAML or JSON; layout in
 *  docs/formats/rig.md. The rig is validated.
 *  @return kNotFound, kBadData or validate()'s code; the message begins with the path */
Status load_rig (const std::string &path, Rig &rig);
/** Writes the same text that cv::FileStorage would. @return kBadValue, kNotFound; the message
 * begins with the path */
Status save_rig (const std::string &path, const Rig &rig);

} // namespace rangecast
