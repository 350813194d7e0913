/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pictures of any RGB-D camera: colour as OpenCV reads it, depth of 16 bits, masks of 8. */
#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <rangecast/geometry/size_text.hpp>

#include "input.hpp"

using namespace rangecast;

namespace bench {
namespace {

Status
read_picture (const char *option, const std::string &path, int flags, cv::Mat &to)
{
  try {
    to = cv::imread (path, flags);
  } catch (const cv::Exception &) { /* of absurd sizes; as what cannot be read */
    to.release ();
  }
  if (to.empty ())
    return {StatusCode::kNotFound, std::string (option) + " " + path +
                                       ": cannot be read, expected a picture (PNG or the like)"};
  return {};
}

Status
expect_size (
    const char *option, const std::string &path, const cv::Mat &is, const cv::Mat &expected)
{
  if (is.size () == expected.size ())
    return {};
  return {StatusCode::kBadSize, std::string (option) + " " + path + ": " +
                                    rangecast::size_text (is.cols, is.rows) + " pixels, expected " +
                                    rangecast::size_text (expected.cols, expected.rows) +
                                    " as --color has"};
}

/* Whether a pixel of a mask of any number of channels keeps its pixel; alpha does not count. */
bool
keeps (const cv::Mat &mask, int y, int x)
{
  const int channels = mask.channels ();
  const std::uint8_t *p = mask.ptr<std::uint8_t> (y) + std::ptrdiff_t{x} * channels;
  return std::any_of (p, p + std::min (channels, 3), [] (std::uint8_t v) { return v != 0; });
}

/* In depth units, inclusive. */
struct Limits {
  double near, far;
};

/* One pair as it is in the files; the mask is empty if there is none. */
struct Pair {
  cv::Mat colour, depth, mask;
};

Status
read_pair (const PictureFiles &files, Pair &to)
{
  if (Status s = read_picture ("--color", files.colour, cv::IMREAD_COLOR, to.colour); !s.ok ())
    return s;
  if (Status s = read_picture ("--depth", files.depth, cv::IMREAD_UNCHANGED, to.depth); !s.ok ())
    return s;
  if (to.depth.type () != CV_16UC1)
    return {StatusCode::kBadData,
        "--depth " + files.depth + ": expected a picture of 16 bits and one channel"};
  if (Status s = expect_size ("--depth", files.depth, to.depth, to.colour); !s.ok ())
    return s;
  if (files.mask.empty ())
    return {};
  if (Status s = read_picture ("--mask", files.mask, cv::IMREAD_UNCHANGED, to.mask); !s.ok ())
    return s;
  if (to.mask.depth () != CV_8U)
    return {StatusCode::kBadData, "--mask " + files.mask + ": expected a picture of 8 bits"};
  return expect_size ("--mask", files.mask, to.mask, to.colour);
}

Status
load_pair (const PictureFiles &files, const Limits &limits, Picture &to)
{
  Pair pair;
  if (Status s = read_pair (files, pair); !s.ok ())
    return s;
  to = Picture (pair.depth.cols, pair.depth.rows);
  std::size_t i = 0, kept = 0, points = 0;
  for (int y = 0; y < to.height; y++)
    for (int x = 0; x < to.width; x++, i++) {
      const std::uint16_t d = pair.depth.at<std::uint16_t> (y, x);
      if (!pair.mask.empty () && !keeps (pair.mask, y, x))
        continue;
      kept++;
      if (!d || d < limits.near || d > limits.far)
        continue;
      const auto &c = pair.colour.at<cv::Vec3b> (y, x);
      to.depth[i] = d;
      to.colour[i] = {c[2], c[1], c[0], 0};
      points++;
    }
  if (!kept)
    return {StatusCode::kBadData, "--mask " + files.mask + ": all zero, expected pixels to keep"};
  if (!points)
    return {StatusCode::kBadData,
        "--depth " + files.depth + ": no pixel left, expected depths within --near and --far" +
            (files.mask.empty () ? "" : " where --mask " + files.mask + " is not zero")};
  return {};
}

/* The limits of the pictures themselves where none are given: least and greatest depth. */
void
fit_limits (const FileSettings &settings, Input &input)
{
  int least = 65535, most = 1;
  for (const FrameSet &set : input.sets)
    for (const ViewPictures &view : set)
      for (const std::uint16_t d : view.person.depth)
        if (d) {
          least = std::min<int> (least, d);
          most = std::max<int> (most, d);
        }
  least = std::min (least, 65534);
  most = std::max (most, least + 1); /* the quantiser wants two depths */
  for (View &view : input.rig.views) {
    view.near_m = settings.near_m > 0 ? settings.near_m : least * view.depth_unit_m;
    view.far_m = settings.far_m > 0 ? settings.far_m : most * view.depth_unit_m;
  }
}

View
make_camera (int id, const Picture &picture, double depth_unit_m)
{
  View view;
  view.id = id;
  view.width = picture.width;
  view.height = picture.height;
  view.intrinsics = {double (picture.width), double (picture.width), (picture.width - 1) / 2.0,
      (picture.height - 1) / 2.0};
  view.depth_unit_m = depth_unit_m;
  return view;
}

} // namespace

Status
load_pictures (const FileSettings &settings, Input &input)
{
  const std::size_t most = kMaxViews;
  if (!settings.sequence && settings.pairs.size () > most)
    return {StatusCode::kBadValue, std::to_string (settings.pairs.size ()) +
                                       " pairs, expected at most 64 views of a frame set; "
                                       "--sequence takes any number of one view"};
  /* Half a unit wider, so that a limit in metres takes the depth it names. */
  const double unit = settings.depth_unit_m;
  const Limits limits = {
      settings.near_m / unit - 0.5, settings.far_m > 0 ? settings.far_m / unit + 0.5 : 65535};
  if (!settings.sequence)
    input.sets.emplace_back ();
  for (const PictureFiles &files : settings.pairs) {
    Picture p;
    if (Status s = load_pair (files, limits, p); !s.ok ())
      return s;
    const int id = settings.sequence ? 0 : int (input.rig.views.size ());
    if (input.rig.views.empty () || !settings.sequence)
      input.rig.views.push_back (make_camera (id, p, unit));
    const View &view = input.rig.views.back ();
    if (p.width != view.width || p.height != view.height)
      return {StatusCode::kBadSize,
          "--color " + files.colour + ": " + std::to_string (p.width) + "x" +
              std::to_string (p.height) + " pixels, expected " + std::to_string (view.width) + "x" +
              std::to_string (view.height) + " as the pictures of the --sequence before it"};
    if (settings.sequence)
      input.sets.emplace_back ();
    input.sets.back ().push_back (make_view (id, std::move (p)));
  }
  fit_limits (settings, input);
  input.name = settings.pairs[0].colour;
  return validate (input.rig);
}

} // namespace bench
