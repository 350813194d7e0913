/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "../base/status.hpp"

namespace rangecast {

/** What a file may be. */
struct StorageLimits {
  std::uint64_t max_bytes = 64 << 20; ///< unpacked, where it is compressed
  std::string_view binary_type = "";  ///< of data in base64, as OpenCV writes it ("8f"); "": none
};

/** Whether cv::FileStorage may be given a file of somebody else's to read. Its parsers (of 4.6)
 * call themselves once for each level of nesting, so that a short file ends the process; never end
 * at binary data whose header names no type, or at YAML with something behind its first collection;
 * and read beyond lines that hold a 0. Refuses XML, files with more collections than any of ours
 * has, binary data with another header, control characters, and YAML that is not one map of fields
 * at the beginning of lines. Reads the file once, in blocks (also .gz).
 *  @return kBadData that begins with the path; kOk too if the file cannot be opened */
Status check_storage (const std::string &path, const StorageLimits &limits = {});

} // namespace rangecast
