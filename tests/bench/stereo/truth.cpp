/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/geometry/range_image.hpp>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

Status
decode_pfm (const std::vector<std::uint8_t> &bytes, cv::Mat &values)
{
  const std::string head (
      bytes.begin (), bytes.begin () + std::min<std::size_t> (80, bytes.size ()));
  int width = 0, height = 0, end = 0;
  double scale = 0;
  if (std::sscanf (head.c_str (), "Pf %d %d %lf%n", &width, &height, &scale, &end) != 3 ||
      scale == 0)
    return {StatusCode::kBadData, "is no PFM of one channel: expected 'Pf', size and scale"};
  if (width < 1 || height < 1 || width > rangecast::kMaxImageSide ||
      height > rangecast::kMaxImageSide)
    return {StatusCode::kBadData, "PFM: expected a size from 1x1 to 16384x16384"};
  const std::size_t from = std::size_t (end) + 1, row = 4 * std::size_t (width);
  if (bytes.size () < from + row * std::size_t (height))
    return {StatusCode::kTruncated, "PFM: ends too early for its size"};
  values.create (height, width, CV_32F);
  for (int y = 0; y < height; y++) /* the bottom row comes first */
    for (int x = 0; x < width; x++) {
      std::uint8_t b[4];
      std::memcpy (
          b, bytes.data () + from + row * std::size_t (height - 1 - y) + 4 * std::size_t (x), 4);
      if (scale > 0) /* big-endian */
        std::swap (b[0], b[3]), std::swap (b[1], b[2]);
      std::memcpy (&values.at<float> (y, x), b, 4);
    }
  return {};
}

static Status
decode_picture (const std::vector<std::uint8_t> &bytes, cv::Mat &values)
{
  cv::Mat picture;
  try {
    picture = cv::imdecode (bytes, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception &) {
    picture.release ();
  }
  if (picture.empty ())
    return {StatusCode::kBadData, "expected a grey picture, PFM, NPZ or NPY"};
  if (picture.channels () == 4)
    cv::cvtColor (picture, picture, cv::COLOR_BGRA2GRAY);
  else if (picture.channels () == 3)
    cv::cvtColor (picture, picture, cv::COLOR_BGR2GRAY);
  picture.convertTo (values, CV_32F);
  return {};
}

static bool
begins_with (const std::vector<std::uint8_t> &bytes, const char *text)
{
  return bytes.size () >= std::strlen (text) &&
         !std::memcmp (bytes.data (), text, std::strlen (text));
}

static Status
decode (const std::vector<std::uint8_t> &bytes, cv::Mat &values)
{
  if (begins_with (bytes, "Pf"))
    return decode_pfm (bytes, values);
  if (begins_with (bytes, "PK"))
    return decode_npz (bytes, values);
  if (begins_with (bytes, "\x93NUMPY"))
    return decode_npy (bytes.data (), bytes.size (), values);
  return decode_picture (bytes, values);
}

Status
read_truth (const std::string &path, double scale, cv::Mat &truth)
{
  std::ifstream file (path, std::ios::binary);
  const std::vector<std::uint8_t> bytes ((std::istreambuf_iterator<char> (file)), {});
  if (!file.is_open () || bytes.empty ())
    return {StatusCode::kNotFound, path + ": cannot be read, or is empty"};
  if (Status s = decode (bytes, truth); !s.ok ())
    return {s.code (), path + ": " + s.message ()};
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
