/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "storage_check.hpp"

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <opencv2/core/persistence.hpp>
#include <vector>

namespace rangecast {
namespace {

/* Maximum number of characters that may start a collection or element: a rig of 64 views has about
 * 2,000, and each can take about 300 bytes of stack. */
constexpr int kMaxSigns = 10000;
/* Look-ahead of a rule: a marker, the spaces after it, and the header of its data. */
constexpr std::size_t kLookAhead = 512, kBlock = 65536;
/* OpenCV pads the type name to this many bytes, 32 in base64. */
constexpr std::size_t kHeaderBytes = 24;

std::string
encoded_header (std::string_view type)
{
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes (type), text;
  bytes.resize (kHeaderBytes, ' ');
  for (std::size_t i = 0; i < kHeaderBytes; i += 3) {
    const unsigned three =
        unsigned (bytes[i]) << 16 | unsigned (bytes[i + 1]) << 8 | unsigned (bytes[i + 2]);
    for (int shift = 18; shift >= 0; shift -= 6)
      text += kDigits[three >> shift & 63];
  }
  return text;
}

/* "- " starts a list element, "-1" is a number. */
bool
is_sign (std::string_view text)
{
  const char next = text.size () > 1 ? text[1] : '\n';
  return std::string_view ("[{<:").find (text[0]) != std::string_view::npos ||
         (text[0] == '-' && (next == ' ' || next == '\n' || next == '\r' || next == '-'));
}

/* Context before a position: the last character, and the last one that is neither space nor byte
 * order mark. */
struct Before {
  char last = '\n', solid = '\n';

  void add (char c)
  {
    last = c;
    if (std::isgraph (static_cast<unsigned char> (c)))
      solid = c;
  }
};

/* Offset of base64 data if `text` starts with their marker, else 0. The markers are
 * YAML's !!binary and JSON's "$base64$. */
std::size_t
behind_marker (std::string_view text, const Before &before)
{
  static constexpr std::string_view kWord = "binary", kJson = "$base64$";
  if (text.starts_with (kJson))
    return kJson.size ();
  if (!text.starts_with (kWord))
    return 0;
  const bool tag = before.last == '!' || before.last == '^' || before.last == ':';
  return tag ? kWord.size () : 0;
}

/* Checks the text after a marker: on an unexpected character OpenCV would search for data forever.
 */
bool
has_header (std::string_view text, const std::string &header, bool json)
{
  const auto skip = [&] (const char *signs) {
    text.remove_prefix (std::min (text.find_first_not_of (signs), text.size ()));
  };
  const auto skip_one = [&] (const char *signs) {
    if (!text.empty () && std::string_view (signs).find (text[0]) != std::string_view::npos)
      text.remove_prefix (1);
  };
  if (!json) {
    skip_one (">"); /* end of a tag */
    skip (" ");
    skip_one ("|");
    skip (" \r\n");
  }
  return text.starts_with (header);
}

/* Checks that a YAML file is one map with unindented keys. If the collection of a document ends
 * early (a list, a flow collection, an indented map), OpenCV 4.6 takes the rest for the document
 * end, skips three characters, and may then loop forever. Other formats pass. */
class YamlShape {
public:
  /** @param rest  starts with the character to check
   *  @return an error message, or an empty string */
  std::string check (std::string_view rest)
  {
    const char c = rest[0];
    if (part_ == Part::kFirst && static_cast<unsigned char> (c) < 0x80) /* else a byte order mark */
      part_ = c == '%' ? Part::kDirectives : Part::kOther;
    if (part_ == Part::kFirst || part_ == Part::kOther)
      return {};
    if (c == '\r' && rest.size () > 1 && rest[1] != '\n')
      return "has a carriage return within a line";
    if (c == '\n')
      line_ = {};
    std::string error;
    if (std::isgraph (static_cast<unsigned char> (c)) && !line_.ignored)
      error = check_sign (rest);
    line_.column += c != '\n';
    return error;
  }

private:
  enum class Part { kFirst, kOther, kDirectives, kTop, kBody, kEnd };
  struct Line {
    int column = 0;
    bool ignored = false; /* the rest of it */
    bool marked = false;  /* starts with --- or ... */
  };

  std::string check_sign (std::string_view rest)
  {
    const bool begins = line_.column == 0, starts = begins && rest.starts_with ("---"),
               ends = begins && rest.starts_with ("...");
    if (line_.marked && line_.column < 3)
      return {};
    if (rest[0] == '#' || (part_ == Part::kDirectives && begins && rest[0] == '%')) {
      line_.ignored = true;
      return {};
    }
    if (line_.marked || part_ == Part::kEnd || (starts && part_ != Part::kDirectives))
      return "has more than one document, or text behind the marks of its beginning or end";
    if (starts || ends) {
      line_.marked = true;
      part_ = starts ? Part::kTop : Part::kEnd;
      return {};
    }
    if (part_ != Part::kBody &&
        !(begins && (std::isalnum (static_cast<unsigned char> (rest[0])) || rest[0] == '_')))
      return "does not begin with a field at the beginning of a line";
    part_ = Part::kBody;
    line_.ignored = true;
    return {};
  }

  Part part_ = Part::kFirst;
  Line line_;
};

/* Scans text in blocks. */
class StorageScanner {
public:
  explicit StorageScanner (const StorageLimits &limits)
      : limits_ (limits),
        header_ (limits.binary_type.empty () ? "" : encoded_header (limits.binary_type))
  {
  }

  /** Scans the first `count` bytes of `text`; the rest is look-ahead. */
  void scan (std::string_view text, std::size_t count)
  {
    bytes_ += count;
    if (bytes_ > limits_.max_bytes)
      error_ = "has more than " + std::to_string (limits_.max_bytes) + " bytes";
    for (std::size_t i = 0; i < count && error_.empty (); i++) {
      error_ = check (text.substr (i));
      before_.add (text[i]);
    }
  }
  [[nodiscard]] const std::string &error () const { return error_; }

private:
  std::string check (std::string_view rest)
  {
    const char c = rest[0];
    if (std::iscntrl (static_cast<unsigned char> (c)) && c != '\n' && c != '\r' && c != '\t')
      return "has control characters, which no text has";
    if (rest[0] == '<' && before_.solid == '\n')
      return "is XML; expected YAML or JSON";
    if (is_sign (rest) && ++signs_ > kMaxSigns)
      return "has more than " + std::to_string (kMaxSigns) + " lists, maps or fields";
    const std::size_t marker = behind_marker (rest, before_);
    if (marker && header_.empty ())
      return "has binary data";
    if (marker && !has_header (rest.substr (marker), header_, rest[0] == '$'))
      return "has binary data of another type than expected";
    return yaml_.check (rest);
  }

  const StorageLimits limits_;
  std::string header_, error_;
  std::uint64_t bytes_ = 0;
  int signs_ = 0;
  Before before_;
  YamlShape yaml_;
};

} // namespace

Status
check_storage (const std::string &path, const StorageLimits &limits)
{
  /* gzopen() reads uncompressed files, too. OpenCV decides by name. */
  const std::unique_ptr<gzFile_s, int (*) (gzFile)> file (gzopen (path.c_str (), "rb"), gzclose);
  if (!file)
    return {};
  if (!gzdirect (file.get ()) && !path.ends_with (".gz"))
    return {StatusCode::kBadData, path + ": is compressed; expected a name that ends in .gz"};
  StorageScanner scanner (limits);
  std::vector<char> text;
  std::size_t kept = 0;
  for (bool at_end = false; !at_end && scanner.error ().empty ();) {
    text.resize (kept + kBlock);
    const int got = gzread (file.get (), text.data () + kept, kBlock);
    at_end = got < int (kBlock);
    const std::size_t size = kept + std::size_t (std::max (got, 0));
    const std::size_t count = at_end ? size : size - kLookAhead;
    scanner.scan ({text.data (), size}, count);
    std::copy (text.begin () + std::ptrdiff_t (count), text.begin () + std::ptrdiff_t (size),
        text.begin ());
    kept = size - count;
  }
  if (!scanner.error ().empty ())
    return {StatusCode::kBadData, path + ": " + scanner.error ()};
  return {};
}

} // namespace rangecast
