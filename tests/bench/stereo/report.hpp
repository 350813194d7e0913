/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "matchers.hpp"

namespace bench {

/** Prints a table; shares in per cent. */
void print_rows (const std::vector<Row> &rows, bool has_truth);

/** Writes an array of objects, one a row: matcher, density, bad1, bad2 (0 to 1), median_px, ms.
 *  What needs a truth is null without one. @return kNotFound if the file cannot be written */
rangecast::Status write_json (
    const std::string &path, const std::vector<Row> &rows, bool has_truth);

} // namespace bench
