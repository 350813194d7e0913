/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <string_view>

#include "status.hpp"

namespace rangecast {

/** Whether cv::FileStorage may be given a file of somebody else's to read. Its parsers (of 4.6)
 * call themselves once for each level of nesting, so that a short file ends the process; and never
 * end at binary data whose header names no type. Refuses files with more collections than any of
 * ours has, and binary data with another header. Reads the file once, in blocks (also .gz).
 *  @param binary_type  what data in base64 may consist of, as OpenCV writes it ("8f"); "": no such
 *                      data is expected
 *  @return kBadData that begins with the path; kOk too if the file cannot be opened */
Status check_storage (const std::string &path, std::string_view binary_type = "");

} // namespace rangecast
