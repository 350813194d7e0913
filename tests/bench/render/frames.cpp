/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frames.hpp"

#include <algorithm>
#include <list>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/overlap/cylinder_filter.hpp>
#include <rangecast/roi/bounding_box.hpp>
#include <rangecast/roi/segmentation.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

using namespace rangecast;

namespace bench {
namespace {

constexpr int kLearnt = 8; /* pictures of the empty scene */

/* Whole pictures of all views of the rig. */
void
make_room (FrameSet &set, int width, int height)
{
  const auto pixels = static_cast<std::size_t> (width) * static_cast<std::size_t> (height);
  set.depth.assign (set.rig.views.size (), std::vector<std::uint16_t> (pixels));
  set.colour.assign (set.rig.views.size (), std::vector<Rgbx> (pixels));
  set.images.clear ();
  for (std::size_t i = 0; i < set.rig.views.size (); i++)
    set.images.push_back ({set.rig.views[i].id, {0, 0, width, height},
        {set.depth[i].data (), width, height, width * std::ptrdiff_t (sizeof (std::uint16_t))},
        {set.colour[i].data (), width, height, width * std::ptrdiff_t (sizeof (Rgbx))}, 0});
}

void
cut (RangeImage &image, const Roi &box)
{
  image.depth = image.depth.crop (box.x - image.roi.x, box.y - image.roi.y, box.width, box.height);
  image.colour =
      image.colour.crop (box.x - image.roi.x, box.y - image.roi.y, box.width, box.height);
  image.roi = box;
}

/* One stereo camera and what stands in front of it. */
class CameraHost {
public:
  CameraHost (Scene &scene, const View &view, bool with_third)
      : scene_ (scene), view_ (view), with_third_ (with_third),
        left_ (static_cast<std::size_t> (view.width) * static_cast<std::size_t> (view.height)),
        right_ (left_.size ()), third_ (left_.size ())
  {
  }

  /* Before kMoment. */
  Status learn (const RangeImage &image)
  {
    Status status = stereo_.set (view_, {}, with_third_);
    background_.reset (view_.width, view_.height);
    for (int i = 0; i < kLearnt && status.ok (); i++) {
      status = match (kMoment - 0.1 * (kLearnt + 1 - i), true, image);
      if (status.ok ())
        status = background_.learn (image);
    }
    background_.finish ();
    return status;
  }

  Status look (double time_s, RangeImage &image)
  {
    if (Status status = match (time_s, false, image); !status.ok ())
      return status;
    Status status = segmenter_.decide (image, background_, view_.depth_unit_m, {});
    if (status.ok ())
      status = segmenter_.clear (image, background_, view_.depth_unit_m, {});
    cut (image, bounding_box (image, 0));
    return status;
  }

  [[nodiscard]] const View &range_view () const { return stereo_.range_view (); }

private:
  Status match (double time_s, bool empty, const RangeImage &image)
  {
    const auto picture = [&] (std::vector<Rgbx> &pixels) {
      return ImageView<Rgbx>{
          pixels.data (), view_.width, view_.height, view_.width * std::ptrdiff_t (sizeof (Rgbx))};
    };
    Status status =
        scene_.render (view_.id, SceneCamera::kLeft, time_s, empty, picture (left_), {}, {});
    if (status.ok ())
      status =
          scene_.render (view_.id, SceneCamera::kRight, time_s, empty, picture (right_), {}, {});
    if (status.ok () && with_third_)
      status =
          scene_.render (view_.id, SceneCamera::kThird, time_s, empty, picture (third_), {}, {});
    return status.ok () ? stereo_.process (picture (left_), picture (right_), image,
                              with_third_ ? picture (third_) : ImageView<Rgbx>{})
                        : status;
  }

  Scene &scene_;
  const View &view_;
  StereoDepth stereo_;
  BackgroundModel background_;
  Segmenter segmenter_;
  bool with_third_;
  std::vector<Rgbx> left_, right_, third_;
};

Status
filter (FrameSet &set, const CylinderSettings &settings)
{
  CylinderFilter cylinder;
  CylinderResult result;
  const Status status = cylinder.set_rig (set.rig);
  return status.ok () ? cylinder.process (set.images, settings, result) : status;
}

} // namespace

Status
exact_frames (SceneSettings settings, FrameSet &set, double time_s)
{
  settings.noise_sigma = 0;
  std::unique_ptr<Scene> scene;
  if (Status status = Scene::create (settings, scene); !status.ok ())
    return status;
  set.rig = scene->range_rig ();
  make_room (set, settings.width, settings.height);
  std::vector<Roi> boxes (set.images.size ());
  if (Status status = scene->render_range (set.images, time_s, false, boxes, 0); !status.ok ())
    return status;
  for (std::size_t i = 0; i < boxes.size (); i++)
    cut (set.images[i], boxes[i]);
  return {};
}

struct Film::Hosts {
  std::unique_ptr<Scene> scene;
  std::list<CameraHost> all;
};

Film::Film () : hosts_ (std::make_unique<Hosts> ()) {}
Film::~Film () = default;

Status
Film::start (const SceneSettings &settings, bool with_third)
{
  if (Status status = Scene::create (settings, hosts_->scene); !status.ok ())
    return status;
  FrameSet set;
  set.rig = hosts_->scene->range_rig ();
  make_room (set, settings.width, settings.height);
  Status status;
  for (std::size_t i = 0; i < set.images.size () && status.ok (); i++)
    status = hosts_->all.emplace_back (*hosts_->scene, hosts_->scene->rig ().views[i], with_third)
                 .learn (set.images[i]);
  return status;
}

Status
Film::next (double time_s, FrameSet &set)
{
  const View &first = hosts_->scene->rig ().views[0];
  set.rig = hosts_->scene->range_rig ();
  make_room (set, first.width, first.height);
  std::size_t i = 0;
  for (CameraHost &host : hosts_->all) {
    if (Status status = host.look (time_s, set.images[i]); !status.ok ())
      return status;
    set.rig.views[i++] = host.range_view ();
  }
  return code (set, {});
}

Status
stereo_frames (const SceneSettings &settings, const CylinderSettings &cylinder, FrameSet &set)
{
  Film film;
  Status status = film.start (settings);
  if (status.ok ())
    status = film.next (kMoment, set);
  return status.ok () ? filter (set, cylinder) : status;
}

Status
code (FrameSet &set, const EncoderSettings &settings)
{
  AccessUnitEncoder encoder;
  AccessUnitDecoder decoder;
  EncoderResult encoded;
  DecoderResult decoded;
  Status status = encoder.configure (set.rig, settings);
  if (status.ok ())
    status = decoder.set_rig (set.rig);
  if (status.ok ())
    status = encoder.encode (set.images, 1, 1, encoded);
  if (!status.ok ())
    return status;
  const std::vector<std::uint8_t> bytes = encoder.bytes ();
  decoder.plan (bytes, decoded);
  return decoder.decode (set.images, 1, decoded);
}

void
add_smooth_noise (FrameSet &set, double deviation_m)
{
  cv::RNG random (1);
  for (std::size_t i = 0; i < set.images.size (); i++) {
    const RangeImage &image = set.images[i];
    cv::Mat noise (image.depth.height, image.depth.width, CV_32F);
    random.fill (noise, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur (noise, noise, {}, 2);
    cv::Scalar mean, deviation;
    cv::meanStdDev (noise, mean, deviation);
    noise *= deviation_m / set.rig.views[i].depth_unit_m / deviation[0];
    for (int y = 0; y < noise.rows; y++)
      for (int x = 0; x < noise.cols; x++)
        if (std::uint16_t &d = image.depth.at (x, y); d != kInvalidDepth)
          d = static_cast<std::uint16_t> (
              std::clamp (float (d) + noise.at<float> (y, x), 1.f, 65535.f));
  }
}

} // namespace bench
