/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "painter.hpp"

#include <algorithm>
#include <array>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <new>
#include <rangecast/rigfile/rig_file.hpp>

using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::Scene;
using rangecast::SceneCamera;
using rangecast::Status;
using rangecast::StatusCode;

void
AvatarPainter::start (const AvatarSettings &settings)
{
  settings_ = settings;
  scene_.reset ();
  clear_loops ();
}

void
AvatarPainter::clear_loops ()
{
  for (auto &loop : loops_)
    loop = std::vector<Rgbx> ();
}

Status
AvatarPainter::set_size (int width, int height)
{
  rangecast::SceneSettings &s = settings_.scene;
  if (settings_.view_id >= s.views)
    return {StatusCode::kBadValue, "view-id " + std::to_string (settings_.view_id) +
                                       " must be less than views, " + std::to_string (s.views)};
  if (scene_ && s.width == width && s.height == height)
    return {};
  s.width = width;
  s.height = height;
  clear_loops ();
  scene_.reset (); /* a model and its rooms are large: not two at a time */
  if (Status status = Scene::create (s, scene_); !status.ok ())
    return status;
  return settings_.rig_export.empty () ? Status ()
                                       : rangecast::save_rig (settings_.rig_export, scene_->rig ());
}

GstCaps *
AvatarPainter::make_range_caps (int fps_n, int fps_d) const
{
  rangecast::Rig rig = scene_->range_rig ();
  if (settings_.view_id != AvatarSettings::kAllViews)
    rig.views = {*rig.find (settings_.view_id)};
  return gstrange::make_range_caps (gstrange::make_info (rig, fps_n, fps_d));
}

GstCaps *
AvatarPainter::make_raw_caps (int fps_n, int fps_d) const
{
  return gst_caps_new_simple ("video/x-raw", "width", G_TYPE_INT, settings_.scene.width, "height",
      G_TYPE_INT, settings_.scene.height, "framerate", GST_TYPE_FRACTION, fps_n, fps_d,
      "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, "interlace-mode", G_TYPE_STRING, "progressive",
      nullptr);
}

namespace {

double
seconds (GstClockTime time)
{
  return static_cast<double> (time) / GST_SECOND;
}

} // namespace

rangecast::ImageView<Rgbx>
AvatarPainter::looped (SceneCamera camera, guint64 i)
{
  const int width = settings_.scene.width, height = settings_.scene.height;
  return {loops_[int (camera)].data () + i * std::size_t (width) * std::size_t (height), width,
      height, static_cast<std::ptrdiff_t> (sizeof (Rgbx)) * width};
}

Status
AvatarPainter::draw_loop (
    SceneCamera camera, double period_s, const std::function<bool ()> &goes_on)
{
  constexpr std::size_t kMaxPixels = std::size_t{1} << 28; /* 1 GiB */
  const int width = settings_.scene.width, height = settings_.scene.height;
  const std::size_t pixels = std::size_t (width) * std::size_t (height), n = settings_.loop_frames;
  auto &loop = loops_[int (camera)];
  if (!loop.empty ())
    return {};
  if (n > kMaxPixels / pixels)
    return {StatusCode::kBadValue, "loop-frames " + std::to_string (n) + " is more than " +
                                       std::to_string (kMaxPixels / pixels) + " pictures of " +
                                       std::to_string (width) + "x" + std::to_string (height) +
                                       ", which take 1 GiB per camera"};
  try {
    loop.reserve (n * pixels);
  } catch (const std::bad_alloc &) {
    return {StatusCode::kNoSpace, "loop-frames: out of memory for that many frames"};
  }
  for (std::size_t i = 0; i < n && goes_on (); i++) {
    loop.resize ((i + 1) * pixels);
    if (Status s = scene_->render (MAX (settings_.view_id, 0), camera, double (i) * period_s, false,
            looped (camera, i), {}, {});
        !s.ok ())
      return s;
  }
  if (loop.size () < n * pixels)
    loop.clear ();
  return {};
}

/* Looped pictures come forwards, and back again without showing either end twice. */
Status
AvatarPainter::render (
    SceneCamera camera, const FrameTime &time, rangecast::ImageView<Rgbx> picture)
{
  if (loops_[int (camera)].empty () || empty_at (time))
    return scene_->render (MAX (settings_.view_id, 0), camera, seconds (time.capture_time),
        empty_at (time), picture, {}, {});
  const guint64 n = settings_.loop_frames, at = n < 2 ? 0 : time.tick % (2 * n - 2);
  const auto from = looped (camera, at < n ? at : 2 * n - 2 - at);
  for (int y = 0; y < picture.height; y++)
    std::copy_n (from.row (y), picture.width, picture.row (y));
  return {};
}

Status
AvatarPainter::draw_raw (
    SceneCamera camera, const GstVideoInfo &video, const FrameTime &time, GstBuffer *buffer)
{
  GstVideoFrame frame;
  if (!gst_video_frame_map (&frame, &video, buffer, GST_MAP_WRITE))
    return {StatusCode::kNoSpace, "cannot map an output buffer"};
  const rangecast::ImageView<Rgbx> picture{
      static_cast<Rgbx *> (GST_VIDEO_FRAME_PLANE_DATA (&frame, 0)), settings_.scene.width,
      settings_.scene.height, GST_VIDEO_FRAME_PLANE_STRIDE (&frame, 0)};
  const Status status = render (camera, time, picture);
  gst_video_frame_unmap (&frame);
  return status;
}

Status
AvatarPainter::draw_range (const FrameTime &time, GstBuffer *buffer)
{
  for (const auto &view : scene_->range_rig ().views)
    if (settings_.view_id == AvatarSettings::kAllViews || settings_.view_id == view.id)
      if (Status s = gstrange::add_view (
              buffer, view.id, {0, 0, view.width, view.height}, time.capture_time);
          !s.ok ())
        return s;
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  std::array<Roi, rangecast::kMaxViews> boxes;
  const std::size_t count = frame.views ().size ();
  const Status status = scene_->render_range (
      frame.views (), seconds (time.capture_time), empty_at (time), {boxes.data (), count}, 0);
  for (std::size_t i = 0; status.ok () && settings_.person_only && i < count; i++)
    frame.crop (i, boxes[i]);
  return status;
}
