/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

#include "../base/output_path.hpp"
#include "rig.hpp"

namespace rangecast {

/** What the name of a rig file may end in; see check_output_path(). */
inline constexpr std::string_view kRigExtensions[] = {".yml", ".yaml", ".json"};

/** Bytes of the longest rig file that is read: many times what 64 views with three cameras take. */
inline constexpr std::uintmax_t kMaxRigFileSize = std::uintmax_t{4} << 20;

} // namespace rangecast
