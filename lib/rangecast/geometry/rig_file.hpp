/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../output_path.hpp"
#include "rig.hpp"

namespace rangecast {

/** What the name of a rig file may end in; see check_output_path(). */
inline constexpr std::string_view kRigExtensions[] = {".yml", ".yaml", ".json"};

} // namespace rangecast
