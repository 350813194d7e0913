/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/base/status.hpp>
#include <string>
#include <vector>

#include "measure.hpp"

namespace bench {

void print_rows (const std::vector<Row> &rows);
void print_viewers (const std::vector<ViewerRow> &rows);
/** @return kNotFound if the file cannot be written */
rangecast::Status write_json (
    const std::string &path, const std::vector<Row> &rows, const std::vector<ViewerRow> &viewers);

} // namespace bench
