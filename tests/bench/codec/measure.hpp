/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "codec.hpp"

namespace bench {

/** What a codec came to; means over the frame sets. Quality is that of the pixels with depth. */
struct Row {
  std::string codec, settings;
  double bytes = 0;   ///< of a frame set, all views
  double bpvp = 0;    ///< bits per valid pixel, depth and colour together
  double psnr_db = 0; ///< of R, G and B together; infinite without loss
  double depth_rms_mm = 0, depth_max_mm = 0;
  double encode_ms = 0, decode_ms = 0; ///< a frame set, all views, one thread; medians over rounds
};

/** Runs all codecs on all frame sets, codec by codec within each round, so that what else the
 *  machine does hits all alike. A first round, which is not timed, gives bytes and quality.
 *  @return an error that names the codec which failed or lost pixels */
rangecast::Status measure (Input &input, const Codecs &codecs, int rounds, std::vector<Row> &rows);

/** Prints rows in groups of one codec, each with its size beside the peer's at the same PSNR. */
void print_rows (const std::vector<Row> &rows);

/** Writes an array of objects, one a row. @return kNotFound if the file cannot be written */
rangecast::Status write_json (const std::string &path, const std::vector<Row> &rows);

} // namespace bench
