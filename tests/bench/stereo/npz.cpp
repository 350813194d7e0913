/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* NumPy's files: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html, in a zip
 * archive (PKWARE's APPNOTE 6.3, sections 4.3.7, 4.3.12 and 4.3.16). */
#include <zlib.h>

#include <cstring>
#include <rangecast/geometry/range_image.hpp>

#include "truth.hpp"

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 30; /* of one array; more is no picture */

/* Little-endian; the caller keeps it inside. */
std::uint32_t
number (const std::uint8_t *at, int bytes)
{
  std::uint32_t value = 0;
  for (int i = bytes; i-- > 0;)
    value = value << 8 | at[i];
  return value;
}

struct Entry {
  int method = 0;
  std::size_t packed = 0, size = 0, local = 0; /* bytes; `local`: where its local header is */
};

/* The first array of the central directory. */
Status
find_entry (const std::vector<std::uint8_t> &zip, Entry &entry)
{
  const Status bad = {StatusCode::kBadData, "NPZ: expected a zip archive with an array"};
  const std::size_t n = zip.size ();
  std::size_t end = n >= 22 ? n - 22 : 0;
  while (end > 0 && number (&zip[end], 4) != 0x06054b50)
    end--;
  if (end == 0)
    return {StatusCode::kTruncated, "NPZ: the zip archive has no end"};
  std::size_t at = number (&zip[end + 16], 4);
  for (std::uint32_t left = number (&zip[end + 10], 2); left > 0; left--) {
    if (at > n || n - at < 46 || number (&zip[at], 4) != 0x02014b50)
      return bad;
    const std::size_t name = number (&zip[at + 28], 2);
    if (n - at - 46 < name)
      return bad;
    const std::string called (reinterpret_cast<const char *> (&zip[at]) + 46, name);
    entry = {int (number (&zip[at + 10], 2)), number (&zip[at + 20], 4), number (&zip[at + 24], 4),
        number (&zip[at + 42], 4)};
    if (called.ends_with (".npy"))
      return {};
    at += 46 + name + number (&zip[at + 30], 2) + number (&zip[at + 32], 2);
  }
  return bad;
}

Status
inflate_entry (const std::uint8_t *packed, const Entry &entry, std::vector<std::uint8_t> &out)
{
  z_stream stream{};
  if (inflateInit2 (&stream, -MAX_WBITS) != Z_OK) /* no zlib header in a zip */
    return {StatusCode::kNoSpace, "NPZ: zlib has no memory"};
  out.resize (entry.size);
  stream.next_in = const_cast<Bytef *> (packed);
  stream.avail_in = uInt (entry.packed);
  stream.next_out = out.data ();
  stream.avail_out = uInt (out.size ());
  const int result = inflate (&stream, Z_FINISH);
  inflateEnd (&stream);
  if (result != Z_STREAM_END || stream.avail_out != 0)
    return {StatusCode::kBadData, "NPZ: the compressed array is damaged"};
  return {};
}

/* The text after `key` in the header's dictionary, or nothing. */
std::string
field (const std::string &header, const std::string &key)
{
  const std::size_t at = header.find ("'" + key + "':");
  return at == std::string::npos
             ? ""
             : header.substr (header.find_first_not_of (' ', at + key.size () + 3));
}

template <typename T>
void
take (const std::uint8_t *from, cv::Mat &values)
{
  for (int y = 0; y < values.rows; y++)
    for (int x = 0; x < values.cols; x++, from += sizeof (T)) {
      T value;
      std::memcpy (&value, from, sizeof value);
      values.at<float> (y, x) = static_cast<float> (value);
    }
}

struct Kind {
  const char *name;
  std::size_t bytes;
  void (*take) (const std::uint8_t *, cv::Mat &);
};
constexpr Kind kKinds[] = {{"'<f4'", 4, take<float>}, {"'<f8'", 8, take<double>},
    {"'|u1'", 1, take<std::uint8_t>}, {"'|i1'", 1, take<std::int8_t>},
    {"'<u2'", 2, take<std::uint16_t>}, {"'<i2'", 2, take<std::int16_t>},
    {"'<u4'", 4, take<std::uint32_t>}, {"'<i4'", 4, take<std::int32_t>}};

} // namespace

Status
decode_npy (const std::uint8_t *bytes, std::size_t size, cv::Mat &values)
{
  if (size < 12 || std::memcmp (bytes, "\x93NUMPY", 6) != 0)
    return {StatusCode::kBadData, "NPY: does not begin with \\x93NUMPY"};
  const int length_bytes = bytes[6] == 1 ? 2 : 4;
  const std::size_t begin = 8 + std::size_t (length_bytes),
                    length = number (bytes + 8, length_bytes);
  if (size - begin < length)
    return {StatusCode::kTruncated, "NPY: ends in its header"};
  const std::string header (reinterpret_cast<const char *> (bytes) + begin, length);
  int height = 0, width = 0;
  if (std::sscanf (field (header, "shape").c_str (), "(%d, %d)", &height, &width) != 2 ||
      width < 1 || height < 1 || width > rangecast::kMaxImageSide ||
      height > rangecast::kMaxImageSide)
    return {StatusCode::kUnsupported, "NPY: expected an array of two dimensions, 1 to 16384 each"};
  if (!field (header, "fortran_order").starts_with ("False"))
    return {StatusCode::kUnsupported, "NPY: expected fortran_order False"};
  for (const Kind &kind : kKinds)
    if (field (header, "descr").starts_with (kind.name)) {
      if ((size - begin - length) / kind.bytes / std::size_t (width) < std::size_t (height))
        return {StatusCode::kTruncated, "NPY: ends too early for its shape"};
      values.create (height, width, CV_32F);
      kind.take (bytes + begin + length, values);
      return {};
    }
  return {StatusCode::kUnsupported, "NPY: expected little-endian u1 to u4, i1 to i4, f4 or f8"};
}

Status
decode_npz (const std::vector<std::uint8_t> &zip, cv::Mat &values)
{
  Entry entry;
  if (Status s = find_entry (zip, entry); !s.ok ())
    return s;
  const std::size_t n = zip.size ();
  if (entry.size > kMaxBytes || entry.local > n || n - entry.local < 30)
    return {StatusCode::kBadData, "NPZ: the array is larger than 1 GiB, or not in the file"};
  const std::size_t at =
      entry.local + 30 + number (&zip[entry.local + 26], 2) + number (&zip[entry.local + 28], 2);
  if (at > n || n - at < entry.packed)
    return {StatusCode::kTruncated, "NPZ: ends in its array"};
  if (entry.method == 0)
    return decode_npy (&zip[0] + at, entry.packed, values);
  if (entry.method != 8)
    return {StatusCode::kUnsupported, "NPZ: expected arrays stored or deflated"};
  std::vector<std::uint8_t> array;
  if (Status s = inflate_entry (&zip[0] + at, entry, array); !s.ok ())
    return s;
  return decode_npy (array.data (), array.size (), values);
}

} // namespace bench
