/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "json.hpp"

#include <algorithm>
#include <charconv>
#include <climits>
#include <cmath>
#include <cstdint>

namespace rangecast {

namespace {

const Json kNothing;
constexpr int kMaxLevels = 64, kMaxValues = 4'000'000;

class Parser {
public:
  explicit Parser (std::string_view text) : at_ (text.data ()), end_ (text.data () + text.size ())
  {
  }

  Status document (Json &value)
  {
    const bool parsed = this->value (value, 0);
    skip_space ();
    if (parsed && at_ == end_)
      return {};
    if (values_ > kMaxValues)
      return {StatusCode::kUnsupported, "more than 4 million JSON values"};
    return {StatusCode::kBadData, "not JSON"};
  }

private:
  void skip_space ()
  {
    while (at_ < end_ && (*at_ == ' ' || *at_ == '\t' || *at_ == '\n' || *at_ == '\r'))
      at_++;
  }

  bool consume (char c)
  {
    skip_space ();
    if (at_ == end_ || *at_ != c)
      return false;
    at_++;
    return true;
  }

  bool word (std::string_view expected)
  {
    if (!std::string_view (at_, std::size_t (end_ - at_)).starts_with (expected))
      return false;
    at_ += expected.size ();
    return true;
  }

  bool value (Json &value, int level)
  {
    skip_space ();
    if (at_ == end_ || level > kMaxLevels || ++values_ > kMaxValues)
      return false;
    switch (*at_) {
      case '{':
        return object (value, level);
      case '[':
        return array (value, level);
      case '"':
        value.type = Json::Type::kString;
        return string (value.text);
      case 't':
      case 'f':
        value.type = Json::Type::kBool;
        value.number = *at_ == 't';
        return word (*at_ == 't' ? "true" : "false");
      case 'n':
        return word ("null");
      default:
        value.type = Json::Type::kNumber;
        return number (value.number);
    }
  }

  bool object (Json &value, int level)
  {
    value.type = Json::Type::kObject;
    at_++;
    if (consume ('}'))
      return true;
    do {
      skip_space ();
      if (!string (value.names.emplace_back ()) || !consume (':') ||
          !this->value (value.items.emplace_back (), level + 1))
        return false;
    } while (consume (','));
    return consume ('}');
  }

  bool array (Json &value, int level)
  {
    value.type = Json::Type::kArray;
    at_++;
    if (consume (']'))
      return true;
    do {
      if (!this->value (value.items.emplace_back (), level + 1))
        return false;
    } while (consume (','));
    return consume (']');
  }

  bool number (double &value)
  {
    const char *from = at_;
    const bool negative = word ("-");
    const char *whole = at_;
    if (!word ("0") && !digits ()) /* no digit follows a leading zero */
      return false;
    auto magnitude = *whole == '0' ? 0 : at_ - whole; /* of the first digit that is not zero */
    if (const char *point = at_; word (".")) {
      if (!digits ())
        return false;
      if (magnitude == 0)
        magnitude = point + 1 - std::find_if (point + 1, at_, [] (char c) { return c != '0'; });
    }
    bool negative_exponent = false;
    std::ptrdiff_t exponent = 0;
    if (word ("e") || word ("E")) {
      negative_exponent = word ("-");
      if (!negative_exponent)
        word ("+");
      const char *first = at_;
      if (!digits ())
        return false;
      if (std::from_chars (first, at_, exponent).ec != std::errc ())
        exponent = PTRDIFF_MAX / 2;
    }
    if (std::from_chars (from, at_, value).ec == std::errc::result_out_of_range) {
      const bool large = magnitude + (negative_exponent ? -exponent : exponent) > 0;
      value = large ? (negative ? -HUGE_VAL : HUGE_VAL) : 0;
    }
    return true;
  }

  bool digits ()
  {
    const char *from = at_;
    while (at_ < end_ && *at_ >= '0' && *at_ <= '9')
      at_++;
    return at_ > from;
  }

  bool hex (unsigned &unit)
  {
    if (end_ - at_ < 4)
      return false;
    const auto [next, error] = std::from_chars (at_, at_ + 4, unit, 16);
    at_ += 4;
    return error == std::errc () && next == at_;
  }

  static void append_utf8 (unsigned c, std::string &text)
  {
    if (c < 0x80) {
      text += char (c);
    } else if (c < 0x800) {
      text += {char (0xc0 | c >> 6), char (0x80 | (c & 0x3f))};
    } else if (c < 0x10000) {
      text += {char (0xe0 | c >> 12), char (0x80 | (c >> 6 & 0x3f)), char (0x80 | (c & 0x3f))};
    } else {
      text += {char (0xf0 | c >> 18), char (0x80 | (c >> 12 & 0x3f)), char (0x80 | (c >> 6 & 0x3f)),
          char (0x80 | (c & 0x3f))};
    }
  }

  /* After the backslash. */
  bool escape (std::string &text)
  {
    if (at_ == end_)
      return false;
    constexpr std::string_view kShort = "\"\\/bfnrt", kMeant = "\"\\/\b\f\n\r\t";
    const char c = *at_++;
    if (const auto i = kShort.find (c); i != std::string_view::npos) {
      text += kMeant[i];
      return true;
    }
    unsigned unit, low;
    if (c != 'u' || !hex (unit))
      return false;
    if (unit >= 0xd800 && unit < 0xdc00) { /* the first half of a pair */
      if (!word ("\\u") || !hex (low) || low < 0xdc00 || low > 0xdfff)
        return false;
      unit = 0x10000 + ((unit - 0xd800) << 10) + (low - 0xdc00);
    } else if (unit >= 0xdc00 && unit < 0xe000) { /* a second half alone */
      return false;
    }
    append_utf8 (unit, text);
    return true;
  }

  bool string (std::string &text)
  {
    if (at_ == end_ || *at_++ != '"')
      return false;
    while (at_ < end_ && *at_ != '"') {
      const char *from = at_;
      while (at_ < end_ && *at_ != '"' && *at_ != '\\')
        at_++;
      text.append (from, at_);
      if (at_ < end_ && *at_ == '\\' && (at_++, !escape (text)))
        return false;
    }
    return at_ < end_ && *at_++ == '"';
  }

  const char *at_, *end_;
  int values_ = 0;
};

} // namespace

const Json &
Json::operator[] (std::string_view name) const
{
  for (std::size_t i = 0; i < names.size (); i++)
    if (names[i] == name)
      return items[i];
  return kNothing;
}

const Json &
Json::operator[] (std::size_t i) const
{
  return type == Type::kArray && i < items.size () ? items[i] : kNothing;
}

double
Json::number_or (double otherwise) const
{
  return type == Type::kNumber && std::isfinite (number) ? number : otherwise;
}

int
Json::index () const
{
  const bool whole = type == Type::kNumber && number >= 0 && number <= INT_MAX;
  return whole && number == std::floor (number) ? int (number) : -1;
}

std::size_t
Json::size_or (std::size_t otherwise) const
{
  const bool whole = type == Type::kNumber && number >= 0 && number <= 9007199254740992.0;
  return whole && number == std::floor (number) ? std::size_t (number) : otherwise;
}

Status
parse_json (std::string_view text, Json &value)
{
  value = {};
  return Parser (text).document (value);
}

} // namespace rangecast
