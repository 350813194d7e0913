/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <exception>
#include <new>
#include <string>

#include "status.hpp"

namespace rangecast {

/** Runs work (), which returns a Status, and makes one of whatever it throws: where exceptions must
 *  not go further, at the core's border and in functions that C calls.
 *  @param what  of whom the text speaks, as "cylinder"
 *  @return what work () returns, else kNoSpace */
template <typename Work>
[[nodiscard]] Status
guarded (const char *what, const Work &work) noexcept
{
  const auto failed = [what] (const char *how) -> Status {
    try {
      return {StatusCode::kNoSpace, std::string (what) + ": " + how};
    } catch (...) {
      return {StatusCode::kNoSpace, "no memory"}; /* short enough to need none */
    }
  };
  try {
    return work ();
  } catch (const std::bad_alloc &) {
    return failed ("out of memory");
  } catch (...) {
    return failed ("internal error");
  }
}

} // namespace rangecast
