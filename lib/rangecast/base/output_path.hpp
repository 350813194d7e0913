/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "status.hpp"

namespace rangecast {

/** Whether the name says the kind of file. @param extensions  as ".yml"; one is enough
 *  @return kBadValue that names the path and the extensions */
Status check_extension (const std::string &path, std::span<const std::string_view> extensions);

/** Whether a file can be written there, before much work is done for it. Leaves what is there
 *  alone.
 *  @return check_extension()'s status, else kBadValue or kNotFound that names the path */
Status check_output_path (const std::string &path, std::span<const std::string_view> extensions);

} // namespace rangecast
