/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

using namespace rangecast;

namespace bench {
namespace {

/* One moment, and what is true about it. */
struct Shot {
  cv::Mat left, right, third, depth, mask;
  Roi box;
};

template <typename T>
ImageView<T>
view_of (const cv::Mat &m)
{
  return {reinterpret_cast<T *> (m.data), m.cols, m.rows, std::ptrdiff_t (m.step)};
}

Status
render (Scene &scene, const SceneSettings &s, double time_s, Shot &shot)
{
  for (cv::Mat *m : {&shot.left, &shot.right, &shot.third})
    m->create (s.height, s.width, CV_8UC4);
  shot.depth.create (s.height, s.width, CV_16U);
  shot.mask.create (s.height, s.width, CV_8U);
  Status status = scene.render (0, SceneCamera::kLeft, time_s, false, view_of<Rgbx> (shot.left),
      view_of<std::uint16_t> (shot.depth), view_of<std::uint8_t> (shot.mask));
  if (status.ok ())
    status =
        scene.render (0, SceneCamera::kRight, time_s, false, view_of<Rgbx> (shot.right), {}, {});
  if (status.ok ())
    status =
        scene.render (0, SceneCamera::kThird, time_s, false, view_of<Rgbx> (shot.third), {}, {});
  const cv::Rect box = cv::boundingRect (shot.mask);
  shot.box = {box.x, box.y, box.width, box.height};
  return status;
}

/* Adds up what depth pictures are worth. */
class Judge {
public:
  explicit Judge (const View &view, double focal_baseline)
      : unit_ (view.depth_unit_m), focal_baseline_ (focal_baseline)
  {
  }
  void add (const Shot &shot, const cv::Mat &depth)
  {
    for (int y = 0; y < depth.rows; y++)
      for (int x = 0; x < depth.cols; x++) {
        const double z = depth.at<std::uint16_t> (y, x) * unit_,
                     t = shot.depth.at<std::uint16_t> (y, x) * unit_;
        person_ += t > 0;
        valid_ += z > 0;
        found_ += z > 0 && t > 0;
        off_ += z > 0 && (t <= 0 || std::abs (z - t) > 0.05);
        if (z <= 0 || t <= 0)
          continue;
        errors_.push_back (std::abs (z - t));
        if (const double d = focal_baseline_ * (1 / z - 1 / t); std::abs (d) < 2)
          squares_ += d * d, good_++;
      }
  }
  SceneRow row (const std::string &name, std::vector<double> times)
  {
    if (errors_.empty () || times.empty ())
      return {name};
    std::ranges::nth_element (errors_, errors_.begin () + std::ptrdiff_t (errors_.size () / 2));
    std::ranges::nth_element (times, times.begin () + std::ptrdiff_t (times.size () / 2));
    return {name, found_ / double (person_), off_ / double (std::max (valid_, 1)),
        1000 * errors_[errors_.size () / 2], std::sqrt (squares_ / std::max (good_, 1)),
        times[times.size () / 2]};
  }

private:
  double unit_, focal_baseline_, squares_ = 0;
  int person_ = 0, valid_ = 0, found_ = 0, off_ = 0, good_ = 0;
  std::vector<double> errors_;
};

double
ms_since (std::chrono::steady_clock::time_point begin)
{
  return std::chrono::duration<double, std::milli> (std::chrono::steady_clock::now () - begin)
      .count ();
}

} // namespace

void
print_scene_rows (const std::vector<SceneRow> &rows)
{
  std::printf (
      "%-44s %9s %9s %9s %9s %9s\n", "matcher", "person", "off 5 cm", "median mm", "rms px", "ms");
  for (const SceneRow &r : rows)
    std::printf ("%-44s %7.2f %% %7.3f %% %9.3f %9.3f %9.2f\n", r.matcher.c_str (), 100 * r.found,
        100 * r.off_5cm, r.median_mm, r.rms_px, r.ms);
}

Status
run_scene (const SceneJob &job, std::vector<SceneRow> &rows)
{
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (job.scene, scene); !s.ok ())
    return s;
  std::vector<Shot> shots (std::size_t (job.frames));
  for (std::size_t i = 0; i < shots.size (); i++)
    if (Status s = render (*scene, job.scene, 0.04 * double (i) + double (i / 3), shots[i]);
        !s.ok ())
      return s;
  View view = scene->rig ().views[0];
  StereoDepth stereo;
  if (Status s = stereo.set (view, job.settings); !s.ok ())
    return s;
  Judge ours (view, view.intrinsics.fx * job.scene.baseline_m);
  std::vector<double> times;
  cv::Mat depth (shots[0].depth.size (), CV_16U), colour (depth.size (), CV_8UC4);
  for (const Shot &shot : shots)
    for (int round = 0; round < job.rounds; round++) {
      const auto begin = std::chrono::steady_clock::now ();
      if (Status s =
              stereo.process (view_of<const Rgbx> (shot.left), view_of<const Rgbx> (shot.right),
                  {0, {0, 0, depth.cols, depth.rows}, view_of<std::uint16_t> (depth),
                      view_of<Rgbx> (colour), 0});
          !s.ok ())
        return s;
      times.push_back (ms_since (begin));
      if (!round)
        ours.add (shot, depth);
      if (!round && std::getenv ("F4PNG") && &shot == &shots[0]) {
        cv::Mat o;
        depth.convertTo (o, CV_8U, 1 / 40.);
        cv::imwrite ("/tmp/f4-scene.png", o);
        shot.depth.convertTo (o, CV_8U, 1 / 40.);
        cv::imwrite ("/tmp/f4-truth.png", o);
        cv::imwrite ("/tmp/f4-left.png", shot.left);
        cv::Mat e (depth.size (), CV_8UC3, cv::Scalar::all (0));
        for (int y = 0; y < e.rows; y++)
          for (int x = 0; x < e.cols; x++) {
            int z = depth.at<ushort> (y, x), t = shot.depth.at<ushort> (y, x);
            auto &p = e.at<cv::Vec3b> (y, x);
            if (z && (!t || std::abs (z - t) > 500))
              p = {0, 0, 255};
            else if (z)
              p = {90, 90, 90};
            else if (t)
              p = {255, 0, 0};
          }
        cv::imwrite ("/tmp/f4-err.png", e);
      }
    }
  rows.push_back (ours.row ("stereodepth", times));
  return {};
}

} // namespace bench
