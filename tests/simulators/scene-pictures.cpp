/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene-pictures.hpp"

#include <algorithm>
#include <span>

namespace {

using rangecast::ImageView;
using rangecast::Rgbx;
using rangecast::Status;

} // namespace

int
bytes_per_pixel (std::uint32_t format)
{
  switch (format) {
    case kMono8:
    case kBayerGr8:
    case kBayerRg8:
    case kBayerGb8:
    case kBayerBg8:
      return 1;
    case kRgb8:
      return 3;
    default:
      return 0;
  }
}

/* ---- time ---- */

std::int64_t
Moments::at (std::int64_t now_ns)
{
  std::lock_guard guard (lock_);
  if (last_ns_ < 0 || std::abs (now_ns - last_ns_) >= period_ns_ / 2)
    last_ns_ = now_ns;
  return last_ns_;
}

void
EmptyPhase::camera_starts ()
{
  std::lock_guard guard (lock_);
  if (cameras_++ == 0) {
    first_ns_ = end_ns_ = -1;
    pictures_ = 0;
  }
}

void
EmptyPhase::camera_stops ()
{
  std::lock_guard guard (lock_);
  cameras_--;
}

bool
EmptyPhase::at (std::int64_t moment_ns)
{
  std::lock_guard guard (lock_);
  if (first_ns_ < 0)
    first_ns_ = last_ns_ = moment_ns;
  /* All pictures of one moment show the same scene, so the phase ends with a new moment. */
  const bool ends = moment_ns > last_ns_ && moment_ns >= first_ns_ + length_ns_ &&
                    pictures_ >= frames_ * cameras_;
  last_ns_ = std::max (last_ns_, moment_ns);
  pictures_++;
  if (end_ns_ < 0 && (ends || frames_ == 0))
    end_ns_ = moment_ns;
  return end_ns_ < 0 || moment_ns < end_ns_;
}

namespace {

/* ---- pixels ---- */

/* Even columns of even rows, odd columns of even rows, and the same of odd rows. */
void
paint_bayer (ImageView<const Rgbx> in, std::uint32_t format, std::uint8_t *out)
{
  static constexpr std::uint8_t Rgbx::*kTiles[4][4] = {
      {&Rgbx::g, &Rgbx::r, &Rgbx::b, &Rgbx::g},
      {&Rgbx::r, &Rgbx::g, &Rgbx::g, &Rgbx::b},
      {&Rgbx::g, &Rgbx::b, &Rgbx::r, &Rgbx::g},
      {&Rgbx::b, &Rgbx::g, &Rgbx::g, &Rgbx::r},
  };
  const auto &tile = kTiles[format - kBayerGr8];
  for (int y = 0; y < in.height; y++) {
    const Rgbx *row = in.row (y);
    const auto even = tile[y % 2 * 2], odd = tile[y % 2 * 2 + 1];
    for (int x = 0; x < in.width; x++)
      *out++ = row[x].*(x % 2 ? odd : even);
  }
}

void
paint_pixels (ImageView<const Rgbx> in, std::uint32_t format, std::uint8_t *out)
{
  if (format != kRgb8 && format != kMono8)
    return paint_bayer (in, format, out);
  for (int y = 0; y < in.height; y++)
    for (const Rgbx &pixel : std::span (in.row (y), std::size_t (in.width)))
      if (format == kRgb8)
        for (const std::uint8_t channel : {pixel.r, pixel.g, pixel.b})
          *out++ = channel;
      else /* 0.299, 0.587, 0.114 in 1/256 */
        *out++ = static_cast<std::uint8_t> ((77 * pixel.r + 150 * pixel.g + 29 * pixel.b) >> 8);
}

} // namespace

ScenePictures::ScenePictures (std::shared_ptr<rangecast::Scene> scene, int view_id,
    rangecast::SceneCamera camera, std::int64_t period_ns, int loop)
    : scene_ (std::move (scene)), view_id_ (view_id), camera_ (camera), period_ns_ (period_ns),
      kept_ (loop > 0 ? std::size_t (loop) + 1 : 0)
{
  const rangecast::View *view = scene_->rig ().find (view_id);
  width_ = view->width;
  height_ = view->height;
  sensor_.resize (std::size_t (width_) * height_);
}

Status
ScenePictures::draw (double time_s, bool empty, std::uint32_t format, const SensorRegion &region,
    std::span<std::uint8_t> out)
{
  const ImageView<Rgbx> sensor{
      sensor_.data (), width_, height_, std::ptrdiff_t (sizeof (Rgbx)) * width_};
  if (Status s = scene_->render (view_id_, camera_, time_s, empty, sensor, {}, {}); !s.ok ())
    return s;
  paint_pixels (sensor.crop (region.x, region.y, region.width, region.height), format, out.data ());
  return {};
}

Status
ScenePictures::paint (std::int64_t moment_ns, bool empty, std::uint32_t format,
    const SensorRegion &region, std::span<std::uint8_t> out)
{
  if (kept_.empty ())
    return draw (double (moment_ns) * 1e-9, empty, format, region, out);
  if (format != kept_format_ || !(region == kept_region_))
    for (auto &picture : kept_)
      picture.clear ();
  kept_format_ = format;
  kept_region_ = region;
  /* to the nearest frame: a trigger comes a little after its tick */
  const std::size_t loop = kept_.size () - 1,
                    phase = std::size_t ((moment_ns + period_ns_ / 2) / period_ns_) % loop;
  auto &picture = kept_[empty ? loop : phase];
  if (picture.empty ()) {
    picture.resize (out.size ());
    const double time_s = double (phase) * double (period_ns_) * 1e-9;
    if (Status s = draw (time_s, empty, format, region, picture); !s.ok ())
      return s;
  }
  std::ranges::copy (picture, out.begin ());
  return {};
}

Status
ScenePictures::prepare (std::uint32_t format, const SensorRegion &region)
{
  std::vector<std::uint8_t> scratch (
      std::size_t (region.width) * region.height * bytes_per_pixel (format));
  for (std::size_t i = 0; i + 1 < std::max<std::size_t> (kept_.size (), 2); i++)
    if (Status s = paint (std::int64_t (i) * period_ns_, false, format, region, scratch); !s.ok ())
      return s;
  return paint (0, true, format, region, scratch);
}
