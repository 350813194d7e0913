/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <opencv2/calib3d.hpp>
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

/* Processor time of all threads since then. */
double
cpu_ms_since (std::clock_t begin)
{
  return 1000.0 * double (std::clock () - begin) / CLOCKS_PER_SEC;
}

/* Adds up what depth pictures are worth. */
class Judge {
public:
  explicit Judge (const View &view, double focal_baseline)
      : unit_ (view.depth_unit_m), focal_baseline_ (focal_baseline)
  {
  }
  /* The least time counts: other programs add to each. */
  void add (const Shot &shot, const cv::Mat &depth, double cpu_ms)
  {
    min_cpu_ms_ = std::min (min_cpu_ms_, cpu_ms);
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
  SceneRow row (const std::string &name)
  {
    SceneRow row = {name};
    row.cpu_ms = min_cpu_ms_;
    if (errors_.empty ())
      return row;
    std::ranges::nth_element (errors_, errors_.begin () + std::ptrdiff_t (errors_.size () / 2));
    row.found = found_ / double (person_);
    row.off_5cm = off_ / double (std::max (valid_, 1));
    row.median_mm = 1000 * errors_[errors_.size () / 2];
    row.rms_px = std::sqrt (squares_ / std::max (good_, 1));
    return row;
  }

private:
  double unit_, focal_baseline_, squares_ = 0, min_cpu_ms_ = INFINITY;
  int person_ = 0, valid_ = 0, found_ = 0, off_ = 0, good_ = 0;
  std::vector<double> errors_;
};

} // namespace

void
print_scene_rows (const std::vector<SceneRow> &rows)
{
  std::printf ("%-44s %9s %9s %9s %9s %9s\n", "matcher", "person", "off 5 cm", "median mm",
      "rms px", "cpu ms");
  for (const SceneRow &r : rows)
    std::printf ("%-44s %7.2f %% %7.3f %% %9.3f %9.3f %9.2f\n", r.matcher.c_str (), 100 * r.found,
        100 * r.off_5cm, r.median_mm, r.rms_px, r.cpu_ms);
}

namespace {

/* Ours on the whole picture or in the person's ROI, whose depths it knows from the picture before.
 */
class OursRun {
public:
  OursRun (const char *name, const View &view, double focal_baseline, bool roi, bool third)
      : name_ (name), judge_ (view, focal_baseline), roi_ (roi), third_ (third)
  {
  }
  Status set (const View &view, int n_threads) { return stereo_.set (view, n_threads, third_); }
  Status run (const Shot &shot, bool counts)
  {
    depth_.create (shot.depth.size (), CV_16U);
    colour_.create (shot.depth.size (), CV_8UC4);
    const Roi whole = {0, 0, depth_.cols, depth_.rows}, &roi = roi_ && ran_ ? shot.box : whole;
    ran_ = true;
    const cv::Rect rect (roi.x, roi.y, roi.width, roi.height);
    depth_.setTo (0);
    const cv::Mat depth = depth_ (rect), colour = colour_ (rect);
    const std::clock_t begin = std::clock ();
    const Status status =
        stereo_.process (view_of<const Rgbx> (shot.left), view_of<const Rgbx> (shot.right),
            {0, roi, view_of<std::uint16_t> (depth), view_of<Rgbx> (colour), 0},
            third_ ? view_of<const Rgbx> (shot.third) : ImageView<const Rgbx>{});
    const double ms = cpu_ms_since (begin);
    if (counts)
      judge_.add (shot, depth_, ms);
    return status;
  }
  SceneRow row () { return judge_.row (name_); }

private:
  std::string name_;
  StereoDepth stereo_;
  Judge judge_;
  bool roi_, third_, ran_ = false;
  cv::Mat depth_, colour_;
};

/* OpenCV's 3-way SGBM alone, from near to far. */
class PeerRun {
public:
  PeerRun (const View &view, double focal_baseline)
      : judge_ (view, focal_baseline), unit_ (view.depth_unit_m), focal_baseline_ (focal_baseline)
  {
    const int least = int (focal_baseline / view.far_m),
              count = (int (focal_baseline / view.near_m) - least + 17) / 16 * 16, area = 3 * 3;
    least_ = least;
    matcher_ = cv::StereoSGBM::create (
        least, count, 3, 8 * area, 32 * area, 1, 31, 0, 100, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  }
  void run (const Shot &shot, bool counts)
  {
    const std::clock_t begin = std::clock ();
    cv::cvtColor (shot.left, left_, cv::COLOR_RGBA2GRAY);
    cv::cvtColor (shot.right, right_, cv::COLOR_RGBA2GRAY);
    matcher_->compute (left_, right_, raw_);
    const double ms = cpu_ms_since (begin);
    if (!counts)
      return;
    depth_.create (raw_.size (), CV_16U);
    for (int y = 0; y < raw_.rows; y++)
      for (int x = 0; x < raw_.cols; x++) {
        const int d = raw_.at<std::int16_t> (y, x);
        depth_.at<std::uint16_t> (y, x) =
            d >= 16 * least_ && d > 0
                ? std::uint16_t (std::lround (focal_baseline_ * 16 / d / unit_))
                : 0;
      }
    judge_.add (shot, depth_, ms);
  }
  SceneRow row () { return judge_.row ("OpenCV SGBM 3-way, whole picture"); }

private:
  Judge judge_;
  double unit_, focal_baseline_;
  int least_;
  cv::Ptr<cv::StereoSGBM> matcher_;
  cv::Mat left_, right_, raw_, depth_;
};

} // namespace

Status
run_scene (const SceneJob &job, std::vector<SceneRow> &rows)
{
  std::unique_ptr<Scene> scene;
  if (Status s = Scene::create (job.scene, scene); !s.ok ())
    return s;
  std::vector<Shot> shots (std::size_t (job.frames) + 1);
  for (std::size_t i = 0; i < shots.size (); i++)
    if (Status s = render (*scene, job.scene, 0.04 * double (i), shots[i]); !s.ok ())
      return s;
  const View &view = scene->rig ().views[0];
  const double focal_baseline = view.intrinsics.fx * job.scene.baseline_m;
  OursRun whole ("stereodepth, whole picture", view, focal_baseline, false, false),
      roi ("stereodepth, person's ROI", view, focal_baseline, true, false),
      whole3 ("stereodepth, third camera, whole picture", view, focal_baseline, false, true),
      roi3 ("stereodepth, third camera, person's ROI", view, focal_baseline, true, true);
  PeerRun peer (view, focal_baseline);
  const std::vector<OursRun *> all = {&whole, &roi, &whole3, &roi3};
  for (OursRun *ours : all)
    if (Status s = ours->set (view, job.n_threads); !s.ok ())
      return s;
  for (const Shot &shot : shots) {
    const bool counts = &shot != &shots[0];
    peer.run (shot, counts);
    for (OursRun *ours : all)
      if (Status s = ours->run (shot, counts); !s.ok ())
        return s;
  }
  std::printf ("person's ROI: %.0f %% of the picture, person: %.0f %%\n",
      100.0 * shots[0].box.width * shots[0].box.height / shots[0].depth.total (),
      100.0 * cv::countNonZero (shots[0].mask) / double (shots[0].mask.total ()));
  for (OursRun *ours : all)
    rows.push_back (ours->row ());
  rows.push_back (peer.row ());
  return {};
}

} // namespace bench
