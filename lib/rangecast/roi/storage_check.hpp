/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "../base/status.hpp"

namespace rangecast {

/** Limits for a file. */
struct StorageLimits {
  std::uint64_t max_bytes = 64 << 20; ///< unpacked, where it is compressed
  std::string_view binary_type = "";  ///< type of base64 data, as OpenCV writes it ("8f"); "": none
};

/** Checks whether an untrusted file is safe to read with cv::FileStorage. The parsers of OpenCV 4.6
 *  recurse for each level of nesting, so that a short file can overflow the stack; loop forever on
 *  binary data without a type, or on YAML with content after its first collection; and read out of
 *  bounds on lines that contain a NUL. Refuses XML, files with more collections than ours have,
 * binary data of another type, control characters, and YAML that is not one map with unindented
 * keys. Reads the file once, in blocks (also .gz).
 *  @return kBadData with a message that starts with the path; kOk also if the file cannot be opened
 */
Status check_storage (const std::string &path, const StorageLimits &limits = {});

} // namespace rangecast
