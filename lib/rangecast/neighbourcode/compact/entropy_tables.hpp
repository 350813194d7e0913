/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The frequencies at the start of entropy slices, counted as tests/bitstream/train.py does. */
#pragma once

#include <cstddef>

namespace rangecast {

/** Of slices with key whose steps are all 1, whose luma step is at most 5, and others; of those
 * without key. */
inline constexpr std::size_t kEntropyTables = 4;
/** Where the intervals of the symbols from 1 on start, three hexadecimal digits each, by context:
 * of choices, and of residuals, ends of runs and motion. */
extern const char *const kInitialChoices[kEntropyTables], *const kInitialNumbers[kEntropyTables];

} // namespace rangecast
