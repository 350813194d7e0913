/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth.hpp"

#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/geometry/range_image.hpp>
#include <vector>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {
namespace {

using Bytes = std::vector<std::uint8_t>;

/* The first file of a zip archive (PKWARE's APPNOTE 6.3, section 4.3.7), which ends where its
 * deflated data say so. */
bool
unzip (const Bytes &zip, Bytes &file)
{
  constexpr std::size_t kMaxBytes = std::size_t{4} * rangecast::kMaxImageSide * 4096;
  if (zip.size () < 30 || zip[8] != 8)
    return false;
  const std::size_t begin = 30 + zip[26] + 256u * zip[27] + zip[28] + 256u * zip[29];
  z_stream stream{};
  if (begin >= zip.size () || inflateInit2 (&stream, -MAX_WBITS) != Z_OK)
    return false;
  stream.next_in = const_cast<Bytef *> (&zip[begin]);
  stream.avail_in = uInt (zip.size () - begin);
  int result = Z_OK;
  while (result == Z_OK && file.size () < kMaxBytes) {
    constexpr std::size_t kMore = 1 << 20;
    file.resize (file.size () + kMore);
    stream.next_out = &file[file.size () - kMore];
    stream.avail_out = kMore;
    result = inflate (&stream, Z_NO_FLUSH);
  }
  file.resize (stream.total_out);
  inflateEnd (&stream);
  return result == Z_STREAM_END;
}

bool
decode_npz (const Bytes &zip, cv::Mat &values)
{
  Bytes array;
  if (!unzip (zip, array) || array.size () < 10)
    return false;
  const std::size_t begin = 10 + array[8] + 256u * array[9];
  if (begin > array.size ())
    return false;
  const std::string header (array.begin () + 10, array.begin () + std::ptrdiff_t (begin));
  const std::size_t shape = header.find ("'shape': (");
  int width = 0, height = 0;
  if (header.find ("'<f4'") == std::string::npos || shape == std::string::npos ||
      std::sscanf (header.c_str () + shape, "'shape': (%d, %d)", &height, &width) != 2 ||
      width < 1 || height < 1 || width > rangecast::kMaxImageSide ||
      (array.size () - begin) / 4 / std::size_t (width) < std::size_t (height))
    return false;
  values.create (height, width, CV_32F);
  std::memcpy (values.data, &array[begin], 4 * values.total ());
  return true;
}

bool
decode (const Bytes &bytes, cv::Mat &values)
{
  if (bytes[0] == 'P' && bytes[1] == 'K')
    return decode_npz (bytes, values);
  const cv::Mat image = cv::imdecode (bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_GRAYSCALE);
  image.convertTo (values, CV_32F);
  return !image.empty ();
}

} // namespace

Status
read_truth (const std::string &path, double scale, cv::Mat &truth)
{
  std::ifstream file (path, std::ios::binary);
  const Bytes bytes ((std::istreambuf_iterator<char> (file)), {});
  if (bytes.size () < 2)
    return {StatusCode::kNotFound, path + ": cannot be read, or is empty"};
  if (!decode (bytes, truth))
    return {StatusCode::kBadData, path + ": use an NPZ of floats or a grey image"};
  int known = 0;
  for (int y = 0; y < truth.rows; y++)
    for (int x = 0; x < truth.cols; x++) {
      float &t = truth.at<float> (y, x);
      t = std::isfinite (t) && t > 0 ? float (t / scale) : 0;
      known += t > 0;
    }
  if (!known)
    return {StatusCode::kBadData, path + ": no pixel with a disparity above 0"};
  return {};
}

} // namespace bench
