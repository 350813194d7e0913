/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../base/status.hpp"

namespace rangecast {

/** A value of a YAML or JSON file. A missing field is a value of type kNone, so that a chain of
 *  look-ups needs one test at its end. */
struct YamlNode {
  enum class Type {
    kNone,   ///< missing, or a field without a value
    kNumber, ///< a decimal number without quotes
    kText,
    kList,
    kMap,
  };

  Type type = Type::kNone;
  std::string text;               ///< of a text, UTF-8; of a number, as written
  std::vector<YamlNode> items;    ///< of a list; of a map, its fields' values
  std::vector<std::string> names; ///< of a map, its fields' names

  /** The field of that name, the first if there are several. */
  [[nodiscard]] const YamlNode &operator[] (std::string_view name) const;
  /** The value of a number; infinite if it is beyond the range of double. */
  [[nodiscard]] std::optional<double> number () const;
  /** The value of a number that is written as an integer and fits into int. */
  [[nodiscard]] std::optional<int> integer () const;
};

/** Limits of a file, far beyond any rig. */
inline constexpr int kMaxYamlDepth = 32;
inline constexpr int kMaxYamlNodes = 100000;

/** Reads a file that cv::FileStorage opens too: YAML that begins with %YAML, or JSON that begins
 *  with {. Aliases are refused: a few of them make a tree of any size.
 *  @param[out] root  a map; unspecified on failure
 *  @return kBadData, or kNotFound if it cannot be opened; the message begins with the path */
Status read_yaml (const std::string &path, std::uint64_t max_bytes, YamlNode &root);

} // namespace rangecast
