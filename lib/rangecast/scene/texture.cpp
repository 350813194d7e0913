/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "texture.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "pattern.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

constexpr std::size_t kMaxFile = std::size_t{256} << 20;

using Bytes = std::span<const std::uint8_t>;

/* Any depth and number of channels to BGRA of 8 bits. */
cv::Mat
to_bgra (cv::Mat picture)
{
  if (picture.depth () == CV_16U)
    picture.convertTo (picture, CV_8U, 1 / 257.0);
  if (picture.depth () != CV_8U)
    return {};
  cv::Mat bgra;
  switch (picture.channels ()) {
    case 1:
      cv::cvtColor (picture, bgra, cv::COLOR_GRAY2BGRA);
      return bgra;
    case 3:
      cv::cvtColor (picture, bgra, cv::COLOR_BGR2BGRA);
      return bgra;
    case 4:
      return picture;
    default:
      return {};
  }
}

std::shared_ptr<const MipMap>
make_texture (cv::Mat bgra, const TextureSettings &settings)
{
  const int side = std::max (bgra.cols, bgra.rows);
  if (side > settings.max_side) {
    const double scale = double (settings.max_side) / side;
    cv::resize (bgra, bgra,
        {std::max (1, int (bgra.cols * scale)), std::max (1, int (bgra.rows * scale))}, 0, 0,
        cv::INTER_AREA);
  }
  std::uint8_t tables[4][256];
  for (int c = 0; c < 4; c++)
    for (int i = 0; i < 256; i++)
      tables[c][i] = to_byte (i * settings.factor[c]);
  std::vector<Rgbx> pixels;
  pixels.reserve (bgra.total ());
  for (int y = 0; y < bgra.rows; y++)
    for (int x = 0; x < bgra.cols; x++) {
      const auto &p = bgra.at<cv::Vec4b> (y, x);
      pixels.push_back ({tables[0][p[2]], tables[1][p[1]], tables[2][p[0]], tables[3][p[3]]});
    }
  return std::make_shared<MipMap> (bgra.cols, bgra.rows, std::move (pixels), settings.alpha_cutoff);
}

} // namespace

Status
decode_texture (Bytes bytes, const std::string &name, const TextureSettings &settings,
    std::shared_ptr<const MipMap> &texture)
{
  const Status bad = {
      StatusCode::kBadData, name + ": is no image that can be read; convert it to JPEG or PNG"};
  if (bytes.empty ())
    return bad;
  try {
    const cv::Mat data (
        1, static_cast<int> (bytes.size ()), CV_8U, const_cast<std::uint8_t *> (bytes.data ()));
    const cv::Mat bgra = to_bgra (cv::imdecode (data, cv::IMREAD_UNCHANGED));
    if (bgra.empty ())
      return bad;
    texture = make_texture (bgra, settings);
  } catch (const std::exception &) { /* OpenCV's decoders */
    return bad;
  }
  return {};
}

Status
read_texture (const std::string &path, const TextureSettings &settings,
    std::shared_ptr<const MipMap> &texture)
{
  std::vector<std::uint8_t> bytes;
  if (Status s = read_file (path, kMaxFile, "a texture (JPEG or PNG)", bytes); !s.ok ())
    return s;
  return decode_texture (bytes, path, settings, texture);
}

Status
read_file (
    const std::string &path, std::size_t limit, const char *what, std::vector<std::uint8_t> &bytes)
{
  std::error_code error;
  const auto size = fs::is_regular_file (path, error) ? fs::file_size (path, error) : 0;
  std::ifstream file (path, std::ios::binary);
  if (error || !fs::is_regular_file (path, error) || !file)
    return {StatusCode::kNotFound, path + ": no such file: " + what};
  if (size > limit)
    return {StatusCode::kUnsupported,
        path + ": larger than " + std::to_string (limit >> 20) + " MiB: " + what};
  bytes.resize (size);
  file.read (reinterpret_cast<char *> (bytes.data ()), static_cast<std::streamsize> (size));
  bytes.resize (static_cast<std::size_t> (file.gcount ()));
  return {};
}

} // namespace rangecast

#endif
