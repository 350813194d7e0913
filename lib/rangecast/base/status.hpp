/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <utility>

namespace rangecast {

/** What went wrong, coarsely: enough for a caller to decide what to do next. */
enum class StatusCode {
  kOk,
  kBadSize,     ///< an image or table has not the size that was promised
  kBadValue,    ///< a parameter or field is outside its range
  kBadData,     ///< foreign bytes (file, blob, slice) that are not what they should be
  kTruncated,   ///< foreign bytes that end too early
  kUnsupported, ///< well-formed, but of a version or profile that this code does not know
  kNotFound,    ///< a file, view or field that should be there is not
  kNoSpace,     ///< the caller's output is too small; its contents are unspecified
  kInterrupted, ///< the caller asked to stop
  kInternal,    ///< an exception that no caller can do anything about
};

/** The result of a core function: kOk, or a code and one sentence that names the thing and what
 *  was expected. An ok Status holds no text and costs no allocation. */
class [[nodiscard]] Status {
public:
  Status () = default;
  Status (StatusCode code, std::string message) : code_ (code), message_ (std::move (message)) {}

  [[nodiscard]] bool ok () const { return code_ == StatusCode::kOk; }
  [[nodiscard]] StatusCode code () const { return code_; }
  [[nodiscard]] const std::string &message () const { return message_; }

private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

} // namespace rangecast
