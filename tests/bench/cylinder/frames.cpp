/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frames.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/rigfile/rig_file.hpp>

using namespace rangecast;

namespace bench {

std::vector<RangeImage>
FrameSet::images ()
{
  std::vector<RangeImage> all;
  for (std::size_t i = 0; i < rig.views.size (); i++) {
    const View &v = rig.views[i];
    all.push_back ({v.id, {0, 0, v.width, v.height},
        {depth[i].data (), v.width, v.height, v.width * 2}, {}, 0});
    if (!colour.empty ())
      all.back ().colour = {colour[i].data (), v.width, v.height, v.width * 4};
  }
  return all;
}

std::vector<RangeImage>
FrameSet::images_in_boxes ()
{
  std::vector<RangeImage> all = images ();
  for (std::size_t i = 0; i < all.size (); i++) {
    const cv::Mat plane (rig.views[i].height, rig.views[i].width, CV_16U, fresh[i].data ());
    const cv::Rect box = cv::boundingRect (plane != 0);
    all[i].roi = {box.x, box.y, box.width, box.height};
    all[i].depth = all[i].depth.crop (box.x, box.y, box.width, box.height);
    if (!colour.empty ())
      all[i].colour = all[i].colour.crop (box.x, box.y, box.width, box.height);
  }
  return all;
}

std::size_t
FrameSet::count () const
{
  std::size_t n = 0;
  for (const auto &plane : depth)
    n += plane.size () - static_cast<std::size_t> (std::count (plane.begin (), plane.end (), 0));
  return n;
}

std::vector<Spot>
spots_of (FrameSet &set)
{
  std::vector<Spot> spots;
  std::size_t first = 0;
  for (std::size_t i = 0; i < set.rig.views.size (); i++) {
    const View &view = set.rig.views[i];
    for (int v = 0; v < view.height; v++)
      for (int u = 0; u < view.width; u++) {
        const std::size_t at = static_cast<std::size_t> (v) * view.width + u;
        if (const int d = set.depth[i][at])
          spots.push_back ({static_cast<int> (i), u, v,
              view.world_from_view * view.intrinsics.unproject (u, v, d * view.depth_unit_m),
              first + at});
      }
    first += set.depth[i].size ();
  }
  return spots;
}

Status
load_bunny (const std::string &folder, FrameSet &set)
{
  if (Status status = load_rig (folder + "/rig.yaml", set.rig); !status.ok ())
    return status;
  for (const View &view : set.rig.views) {
    const std::string path = folder + "/view" + std::to_string (view.id);
    const cv::Mat depth = cv::imread (path + "-depth.png", cv::IMREAD_UNCHANGED),
                  colour = cv::imread (path + "-colour.png", cv::IMREAD_COLOR);
    const cv::Size size (view.width, view.height);
    if (depth.type () != CV_16UC1 || depth.size () != size || colour.size () != size)
      return {StatusCode::kBadData,
          path + ": expected -depth.png, 16 bit, and -colour.png of the rig's size"};
    set.depth.emplace_back (depth.begin<std::uint16_t> (), depth.end<std::uint16_t> ());
    auto &pixels = set.colour.emplace_back ();
    for (auto bgr = colour.begin<cv::Vec3b> (); bgr != colour.end<cv::Vec3b> (); ++bgr)
      pixels.push_back ({(*bgr)[2], (*bgr)[1], (*bgr)[0], 0});
  }
  set.fresh = set.depth;
  set.fresh_colour = set.colour;
  return {};
}

} // namespace bench
