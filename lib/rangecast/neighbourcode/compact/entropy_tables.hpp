/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The frequencies at the start of entropy slices, as counted in scans and recordings. */
#pragma once

#include <cstddef>

namespace rangecast {

/** Of slices with key whose steps are all 1, of others with key, and of those without key. */
inline constexpr std::size_t kEntropyTables = 3;
/** Where the intervals of the symbols from 1 on start, three hexadecimal digits each, by context:
 * of choices (those that occur), and of residuals, ends of runs and motion. */
extern const char *const kInitialChoices[kEntropyTables], *const kInitialNumbers[kEntropyTables];

} // namespace rangecast
