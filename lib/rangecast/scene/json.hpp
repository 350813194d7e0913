/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "../base/status.hpp"

namespace rangecast {

/** A JSON value. Looking up a member or item that is not there gives null, so that a chain of
 *  look-ups needs one test at its end. */
struct Json {
  enum class Type { kNull, kBool, kNumber, kString, kArray, kObject };

  Type type = Type::kNull;
  double number = 0;              ///< of a number; 0 or 1 of a boolean
  std::string text;               ///< of a string, UTF-8
  std::vector<Json> items;        ///< of an array; of an object, its members' values
  std::vector<std::string> names; ///< of an object, its members' names

  [[nodiscard]] bool is_null () const { return type == Type::kNull; }
  [[nodiscard]] std::size_t size () const { return items.size (); }
  [[nodiscard]] const Json &operator[] (std::string_view name) const;
  [[nodiscard]] const Json &operator[] (std::size_t i) const;
  /** @return the value of a number that fits, else `otherwise` */
  [[nodiscard]] double number_or (double otherwise) const;
  /** @return a whole number from 0 to INT_MAX, else -1 */
  [[nodiscard]] int index () const;
  /** @return the same as a size, else `otherwise`; whole numbers up to 2^53 */
  [[nodiscard]] std::size_t size_or (std::size_t otherwise) const;
};

/** Parses RFC 8259 text of at most 64 levels and 4 million values. A number too small for a double
 *  is 0, one too large infinite.
 *  @return kBadData if it is not JSON, kUnsupported if there are more values; `value` is then
 *          unspecified */
Status parse_json (std::string_view text, Json &value);

} // namespace rangecast
