/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Assertions that print the values they compare, for types that ck_assert_int_eq and its like do
 * not know: floating point, std::string, containers, structs. */
#pragma once

#include <algorithm>
#include <gst/check/gstcheck.h>
#include <iterator>
#include <string>
#include <string_view>
#include <type_traits>

namespace rangecast::testing {

template <typename T> std::string value_text (const T &value);

template <typename T>
concept Range = requires (const T &r)
{
  std::begin (r) != std::end (r);
};

/** The first elements, so that a picture does not fill the log. */
template <Range T>
std::string
range_text (const T &range)
{
  constexpr std::ptrdiff_t kMaxElements = 16;
  const auto size = std::distance (std::begin (range), std::end (range));
  std::string text = "{";
  auto element = std::begin (range);
  for (std::ptrdiff_t i = 0; i < std::min (size, kMaxElements); i++, ++element)
    text += (i ? ", " : "") + value_text (*element);
  return text + (size > kMaxElements ? ", ...} of " + std::to_string (size) : "}");
}

template <typename T>
std::string
value_text (const T &value)
{
  if constexpr (std::is_convertible_v<T, std::string_view>)
    return '"' + std::string (std::string_view (value)) + '"';
  else if constexpr (std::is_floating_point_v<T>) {
    char text[32];
    g_snprintf (text, sizeof text, "%.9g", double (value));
    return text;
  } else if constexpr (std::is_arithmetic_v<T>)
    return std::to_string (value);
  else if constexpr (std::is_enum_v<T>)
    return std::to_string (static_cast<std::underlying_type_t<T>> (value));
  else if constexpr (Range<T>)
    return range_text (value);
  else if constexpr (requires { value.first, value.second; })
    return value_text (value.first) + ": " + value_text (value.second);
  else if constexpr (requires { value.x, value.y, value.width, value.height; })
    return std::to_string (value.width) + " x " + std::to_string (value.height) + " at " +
           std::to_string (value.x) + ", " + std::to_string (value.y);
  else if constexpr (requires { *value, value.has_value (); }) // std::optional
    return value ? value_text (*value) : "nothing";
  else
    return "(" + std::to_string (sizeof value) + " bytes)";
}

/** Where two containers part; empty for anything else. */
template <typename A, typename B>
std::string
difference_text (const A &a, const B &b)
{
  if constexpr (Range<A> && Range<B>) {
    const auto [x, y] = std::mismatch (std::begin (a), std::end (a), std::begin (b), std::end (b));
    if (x != std::end (a) && y != std::end (b))
      return "; at index " + std::to_string (std::distance (std::begin (a), x)) + ": " +
             value_text (*x) + " and " + value_text (*y);
  }
  return "";
}

} // namespace rangecast::testing

/** fail_unless (a op b), and what a and b are: fail_unless_cmp (area, <, 0.5). */
#define fail_unless_cmp(a, op, b)                                                                  \
  do {                                                                                             \
    const auto _value_a = (a);                                                                     \
    const auto _value_b = (b);                                                                     \
    fail_unless (_value_a op _value_b, "%s %s %s: %s and %s%s", #a, #op, #b,                       \
        rangecast::testing::value_text (_value_a).c_str (),                                        \
        rangecast::testing::value_text (_value_b).c_str (),                                        \
        rangecast::testing::difference_text (_value_a, _value_b).c_str ());                        \
  } while (0)

/** fail_unless (status.ok ()), and what the status says. */
#define fail_unless_ok(status)                                                                     \
  do {                                                                                             \
    const auto _status = (status);                                                                 \
    fail_unless (_status.ok (), "%s: %s", #status, _status.message ().c_str ());                   \
  } while (0)

/** Fails unless the text holds the part, and prints both. */
#define fail_unless_contains(text, part)                                                           \
  do {                                                                                             \
    const std::string _text (text), _part (part);                                                  \
    fail_unless (_text.find (_part) != _text.npos, "%s: '%s' does not contain '%s'", #text,        \
        _text.c_str (), _part.c_str ());                                                           \
  } while (0)
