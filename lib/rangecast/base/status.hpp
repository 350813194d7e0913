/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <utility>

namespace rangecast {

/** Kinds of failure, as far as callers act differently on them. */
enum class StatusCode {
  kOk,
  kBadSize,     ///< an image or table does not have the expected size
  kBadValue,    ///< a parameter or field is outside its range
  kBadData,     ///< malformed input (file, blob, slice)
  kTruncated,   ///< input that ends too early
  kUnsupported, ///< well-formed input of an unknown version or profile
  kNotFound,    ///< a file, view or field that should be there is not
  kNoSpace,     ///< the caller's output is too small; its contents are unspecified
  kInterrupted, ///< the caller asked to stop
  kInternal,    ///< an unexpected exception
};

/** The result of a core function: kOk, or a code and one sentence that names the thing and what
 *  was expected. An ok Status holds no text and does not allocate. */
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
