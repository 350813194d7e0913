/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "measure.hpp"

namespace bench {

/** Prints rows in groups of one codec, each beside the peer at the same colour PSNR. The peer lies
 *  between its qualities on straight lines: the logarithm of bytes, and milliseconds, over dB. */
void print_rows (const std::vector<Row> &rows);

/** Prints, for some colour PSNRs, the smallest setting of each codec that reaches it.
 *  @param depth_rms_mm  settings with a greater depth error do not count */
void print_choices (const std::vector<Row> &rows, double depth_rms_mm);

/** Whether write_json() will be able to write there. Makes the file if it is not there, and leaves
 *  what it holds. @return kNotFound if not */
rangecast::Status check_json (const std::string &path);

/** Writes an array of objects, one a row. @return kNotFound if the file cannot be written */
rangecast::Status write_json (const std::string &path, const std::vector<Row> &rows);

} // namespace bench
