/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <exception>
#include <new>
#include <string>

#include "status.hpp"

namespace rangecast {

/** Runs work (), which returns a Status, and converts exceptions to one: for the core's interface
 * and for functions that C calls, which exceptions must not leave.
 *  @param what  subject of the text, such as "cylinder"
 *  @return the status of work (), kNoSpace if memory ran out, else kInternal with the exception's
 *  what () */
template <typename Work>
[[nodiscard]] Status
guarded (const char *what, const Work &work) noexcept
{
  const auto failed = [what] (StatusCode code, const char *how, const char *why) -> Status {
    try {
      return {code, std::string (what) + ": " + how + why};
    } catch (...) {
      return {StatusCode::kNoSpace, "no memory"}; /* short enough to need none */
    }
  };
  try {
    return work ();
  } catch (const std::bad_alloc &) {
    return failed (StatusCode::kNoSpace, "out of memory", "");
  } catch (const std::exception &e) {
    return failed (StatusCode::kInternal, "internal error: ", e.what ());
  } catch (...) {
    return failed (StatusCode::kInternal, "internal error", "");
  }
}

} // namespace rangecast
