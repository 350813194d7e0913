/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "yaml_tree.hpp"

#include <yaml.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <new>

namespace rangecast {
namespace {

/* Thrown and caught in this file only: what is wrong with the file. */
struct BadYaml {
  std::string what;
};

std::string
text_of (std::ifstream &file, std::uint64_t max_bytes)
{
  std::string text;
  for (std::size_t size = 0; file; text.resize (size)) {
    constexpr std::size_t kBlock = 65536;
    text.resize (size + kBlock);
    file.read (text.data () + size, kBlock);
    size += std::size_t (file.gcount ());
    if (size > max_bytes)
      throw BadYaml{"has more than " + std::to_string (max_bytes) + " bytes"};
  }
  if (!file.eof ())
    throw BadYaml{"cannot be read to its end"};
  return text;
}

/* cv::FileStorage writes "%YAML:1.0" where YAML has "%YAML 1.0", and \' for ' between double
 * quotes, which neither YAML nor JSON has: the one becomes a comment, the other '. */
std::string
standard_text (std::string_view text)
{
  static constexpr std::string_view kMark = "\xef\xbb\xbf", kYaml = "%YAML";
  if (text.starts_with (kMark))
    text.remove_prefix (kMark.size ());
  if (!text.starts_with (kYaml) && !text.starts_with ('{'))
    throw BadYaml{"must begin with %YAML or { (compressed files are not supported)"};
  std::string standard;
  standard.reserve (text.size ());
  for (std::size_t i = 0; i < text.size (); i++) {
    if (text[i] == '\\' && i + 1 < text.size () && text[++i] != '\'')
      standard += '\\';
    standard += text[i];
  }
  if (standard[0] == '%')
    standard[0] = '#';
  return standard;
}

/* std::from_chars() takes no plus sign. */
std::string_view
without_plus (std::string_view text)
{
  if (text.starts_with ('+') && !text.starts_with ("+-"))
    text.remove_prefix (1);
  return text;
}

/* Whether the whole text is a decimal number; "inf" is not. */
bool
is_number (std::string_view text)
{
  text = without_plus (text);
  const std::size_t sign = text.starts_with ('-'), point = text.substr (sign).starts_with ('.');
  if (text.size () <= sign + point || text[sign + point] < '0' || text[sign + point] > '9')
    return false;
  double value = 0;
  const char *const end = text.data () + text.size ();
  return std::from_chars (text.data (), end, value).ptr == end;
}

class YamlParser {
public:
  explicit YamlParser (std::string_view text)
  {
    if (!yaml_parser_initialize (&parser_))
      throw std::bad_alloc ();
    yaml_parser_set_input_string (
        &parser_, reinterpret_cast<const unsigned char *> (text.data ()), text.size ());
    yaml_parser_set_encoding (&parser_, YAML_UTF8_ENCODING);
  }
  ~YamlParser ()
  {
    yaml_event_delete (&event_);
    yaml_parser_delete (&parser_);
  }
  YamlParser (const YamlParser &) = delete;
  YamlParser &operator= (const YamlParser &) = delete;

  void document (YamlNode &root)
  {
    next (); /* stream begins */
    if (next () != YAML_DOCUMENT_START_EVENT || next () != YAML_MAPPING_START_EVENT)
      throw BadYaml{"is not a map of fields"};
    value (root, 1);
    next (); /* document ends */
    if (next () != YAML_STREAM_END_EVENT)
      throw BadYaml{"has more than one document"};
  }

private:
  yaml_event_type_t next ()
  {
    yaml_event_delete (&event_);
    if (!yaml_parser_parse (&parser_, &event_)) {
      if (parser_.error == YAML_MEMORY_ERROR)
        throw std::bad_alloc ();
      const std::string problem = parser_.problem ? parser_.problem : "is malformed";
      if (parser_.error == YAML_READER_ERROR)
        throw BadYaml{"byte " + std::to_string (parser_.problem_offset) + ": " + problem};
      throw BadYaml{line (parser_.problem_mark) + problem};
    }
    return event_.type;
  }

  static std::string line (const yaml_mark_t &mark)
  {
    return "line " + std::to_string (mark.line + 1) + ": ";
  }

  [[noreturn]] void refuse (const std::string &what) const
  {
    throw BadYaml{line (event_.start_mark) + what};
  }

  /* Reads the value that begins with the current event. */
  void value (YamlNode &node, int depth)
  {
    if (++nodes_ > kMaxYamlNodes)
      refuse ("more than " + std::to_string (kMaxYamlNodes) + " values");
    if (event_.type == YAML_ALIAS_EVENT)
      refuse ("an alias; write the value itself");
    if (event_.type == YAML_SCALAR_EVENT)
      return scalar (node);
    if (depth > kMaxYamlDepth)
      refuse ("lists or maps nested more than " + std::to_string (kMaxYamlDepth) + " deep");
    const bool map = event_.type == YAML_MAPPING_START_EVENT;
    node.type = map ? YamlNode::Type::kMap : YamlNode::Type::kList;
    while (next () != (map ? YAML_MAPPING_END_EVENT : YAML_SEQUENCE_END_EVENT)) {
      if (map) {
        if (event_.type != YAML_SCALAR_EVENT)
          refuse ("a field without a name");
        node.names.push_back (text ());
        next ();
      }
      value (node.items.emplace_back (), depth + 1);
    }
  }

  void scalar (YamlNode &node)
  {
    const auto &scalar = event_.data.scalar;
    const auto tag = reinterpret_cast<const char *> (scalar.tag);
    const bool plain =
        scalar.style == YAML_PLAIN_SCALAR_STYLE && !(tag && std::strcmp (tag, YAML_STR_TAG) == 0);
    node.text = text ();
    if (plain && node.text.empty ())
      return;
    node.type = plain && is_number (node.text) ? YamlNode::Type::kNumber : YamlNode::Type::kText;
  }

  [[nodiscard]] std::string text () const
  {
    return {reinterpret_cast<const char *> (event_.data.scalar.value), event_.data.scalar.length};
  }

  yaml_parser_t parser_{};
  yaml_event_t event_{};
  int nodes_ = 0;
};

} // namespace

const YamlNode &
YamlNode::operator[] (std::string_view name) const
{
  static const YamlNode none;
  const auto found = std::ranges::find (names, name);
  return found == names.end () ? none : items[std::size_t (found - names.begin ())];
}

std::optional<double>
YamlNode::number () const
{
  if (type != Type::kNumber)
    return {};
  const std::string_view digits = without_plus (text);
  double value = 0;
  if (std::from_chars (digits.data (), digits.data () + digits.size (), value).ec ==
      std::errc::result_out_of_range)
    return std::numeric_limits<double>::infinity ();
  return value;
}

std::optional<int>
YamlNode::integer () const
{
  const std::string_view digits = without_plus (text);
  int value = 0;
  const auto [end, error] =
      std::from_chars (digits.data (), digits.data () + digits.size (), value);
  if (type != Type::kNumber || error != std::errc () || end != digits.data () + digits.size ())
    return {};
  return value;
}

Status
read_yaml (const std::string &path, std::uint64_t max_bytes, YamlNode &root)
{
  std::ifstream file (path, std::ios::binary);
  if (!file)
    return {StatusCode::kNotFound, path + ": cannot be opened"};
  root = {};
  try {
    const std::string text = standard_text (text_of (file, max_bytes));
    YamlParser (text).document (root);
  } catch (const BadYaml &bad) {
    return {StatusCode::kBadData, path + ": " + bad.what};
  } catch (const std::bad_alloc &) {
    return {StatusCode::kNoSpace, path + ": no memory left"};
  }
  return {};
}

} // namespace rangecast
