/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "truth.hpp"

#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

using namespace rangecast;

namespace bench {
namespace {

/* A ring of so many cameras, of which some stand at the wanted angle to one of four. */
struct Ring {
  int angle_deg, cameras, which[4];
};
constexpr Ring kRings[] = {{0, 4, {0, 1, 2, 3}}, {20, 18, {1, 8, 10, 17}}, {45, 8, {1, 3, 5, 7}}};

constexpr int kSamples = 2; /* each way, of a pixel */
constexpr double kSeenWithinM = 0.004;

template <typename T>
ImageView<T>
view_of (cv::Mat &m)
{
  return {reinterpret_cast<T *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
}

/* Whether a camera has a depth near a point's, in the pixel that the point falls on or beside it.
 */
bool
sees (const RangeImage &image, const View &view, Vec3 world)
{
  const Vec3 p = view.world_from_view.inverse () * world;
  if (p.z <= 0)
    return false;
  const Intrinsics &lens = view.intrinsics;
  const int u = int (std::lround (lens.fx * p.x / p.z + lens.cx)) - image.roi.x,
            v = int (std::lround (lens.fy * p.y / p.z + lens.cy)) - image.roi.y;
  for (int y = std::max (v - 1, 0); y <= std::min (v + 1, image.roi.height - 1); y++)
    for (int x = std::max (u - 1, 0); x <= std::min (u + 1, image.roi.width - 1); x++)
      if (const int depth = image.depth.at (x, y))
        if (std::abs (depth * view.depth_unit_m - p.z) < kSeenWithinM)
          return true;
  return false;
}

cv::Mat
seen_by (const FrameSet &cameras, const View &from, const cv::Mat &depth)
{
  cv::Mat seen = cv::Mat::zeros (depth.size (), CV_8U);
  for (int y = 0; y < depth.rows; y++)
    for (int x = 0; x < depth.cols; x++) {
      const int z = depth.at<std::uint16_t> (y, x);
      if (z == kInvalidDepth)
        continue;
      const Vec3 world =
          from.world_from_view * from.intrinsics.unproject (x, y, z * from.depth_unit_m);
      for (const RangeImage &image : cameras.images)
        if (sees (image, *cameras.rig.find (image.view_id), world)) {
          seen.at<uchar> (y, x) = 255;
          break;
        }
    }
  return seen;
}

Status
make_scene (SceneSettings settings, const Ring &ring, int samples, std::unique_ptr<Scene> &scene)
{
  settings.views = ring.cameras;
  settings.arc_deg = 360;
  settings.width = kWidth * samples;
  settings.height = kHeight * samples;
  settings.noise_sigma = 0;
  settings.wall_texture = 0; /* the room is not judged, and takes long to draw */
  return Scene::create (settings, scene);
}

/* The figure's own colour and coverage, of pictures with several samples a pixel. */
void
average (const cv::Mat &colour, const cv::Mat &mask, Shot &shot)
{
  cv::Mat rgb, only = cv::Mat::zeros (colour.size (), CV_8UC3), sum, share;
  cv::cvtColor (colour, rgb, cv::COLOR_RGBA2RGB);
  rgb.copyTo (only, mask);
  only.convertTo (only, CV_32F);
  cv::resize (only, sum, {kWidth, kHeight}, 0, 0, cv::INTER_AREA);
  mask.convertTo (share, CV_32F, 1 / 255.0);
  cv::resize (share, share, {kWidth, kHeight}, 0, 0, cv::INTER_AREA);
  share.convertTo (shot.coverage, CV_8U, 255);
  const cv::Mat divisor = cv::max (share, 1e-6);
  cv::Mat divisors;
  cv::merge (std::vector<cv::Mat>{divisor, divisor, divisor}, divisors);
  cv::divide (sum, divisors, sum);
  sum.convertTo (shot.colour, CV_8U);
}

Status
take_shot (
    Scene &fine, Scene &plain, int view_id, double time_s, const FrameSet &cameras, Shot &shot)
{
  cv::Mat colour (kSamples * kHeight, kSamples * kWidth, CV_8UC4), mask (colour.size (), CV_8U),
      small (kHeight, kWidth, CV_8UC4), depth (kHeight, kWidth, CV_16U);
  Status status = fine.render (view_id, SceneCamera::kLeft, time_s, false, view_of<Rgbx> (colour),
      {}, view_of<std::uint8_t> (mask));
  if (status.ok ())
    status = plain.render (view_id, SceneCamera::kLeft, time_s, false, view_of<Rgbx> (small),
        view_of<std::uint16_t> (depth), {});
  if (!status.ok ())
    return status;
  mask *= 255;
  average (colour, mask, shot);
  shot.seen = seen_by (cameras, *plain.range_rig ().find (view_id), depth);
  return {};
}

} // namespace

Status
make_truth (SceneSettings settings, const FrameSet &cameras, int angle_deg,
    std::vector<Shot> &shots, double time_s)
{
  const Ring *ring = kRings;
  while (ring->angle_deg != angle_deg)
    ring++;
  std::unique_ptr<Scene> fine, plain;
  Status status = make_scene (settings, *ring, kSamples, fine);
  if (status.ok ())
    status = make_scene (settings, *ring, 1, plain);
  for (int i = 0; i < 4 && status.ok (); i++) {
    Shot shot;
    shot.azimuth_deg = 360.0 * ring->which[i] / ring->cameras;
    status = take_shot (*fine, *plain, ring->which[i], time_s, cameras, shot);
    shots.push_back (shot);
  }
  return status;
}

} // namespace bench
