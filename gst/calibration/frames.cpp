/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frames.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>

using rangecast::StatusCode;

CalibrationImages::~CalibrationImages ()
{
  for (GstBuffer *&buffer : buffers)
    gst_clear_buffer (&buffer);
}

MappedImages::MappedImages (CalibrationImages &set) : views (set.cameras.size ())
{
  for (std::size_t i = 0; i < set.cameras.size () && status.ok (); i++)
    if (set.buffers[i])
      open (set, i);
}

MappedImages::~MappedImages ()
{
  for (CameraInput *camera : open_)
    camera->reader.close ();
}

void
MappedImages::open (CalibrationImages &set, std::size_t i)
{
  CameraInput &camera = *set.cameras[i];
  const std::string &name = set.described[i].name;
  if (!camera.reader_info || !gst_video_info_is_equal (&*camera.reader_info, &set.infos[i])) {
    camera.reader_info.reset ();
    if (camera.reader.set (set.infos[i]))
      camera.reader_info = set.infos[i];
  }
  if (!camera.reader_info)
    status = {StatusCode::kUnsupported, "pad " + name + ": cannot convert the images to RGBx"};
  else if (!camera.reader.open (set.buffers[i]))
    status = {StatusCode::kBadData, "pad " + name + ": a buffer is smaller than its caps require"};
  else {
    open_.push_back (&camera);
    views[i] = camera.reader.view ();
  }
}

PadFronts::PadFronts (const CameraInputs &cameras, bool live)
{
  for (std::size_t i = 0; i < cameras.size (); i++) {
    GstAggregatorPad *pad = cameras[i]->aggregator_pad ();
    if (GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad))
      list.push_back ({i, buffer, gstrange::capture_time_of (pad, buffer, live),
          gstrange::running_time_of (pad, buffer)});
    else
      (gst_aggregator_pad_is_eos (pad) ? ended : missing)++;
  }
}

PadFronts::~PadFronts ()
{
  for (const Front &front : list)
    gst_buffer_unref (front.buffer);
}

GstClockTime
max_capture_skew (const CameraInputs &cameras)
{
  GstClockTime shortest = GST_CLOCK_TIME_NONE;
  for (const auto &camera : cameras)
    if (camera->info && camera->info->fps_n > 0)
      shortest = std::min (shortest,
          gst_util_uint64_scale_int (GST_SECOND, camera->info->fps_d, camera->info->fps_n));
  return gstrange::pairing_tolerance (shortest);
}

bool
drop_unmatched (const CameraInputs &cameras, const PadFronts &fronts, GstClockTime tolerance,
    GstDebugCategory *category, guint64 &dropped)
{
  GstClockTime latest = 0;
  for (const auto &front : fronts.list)
    if (!gstrange::is_gap (front.buffer))
      latest = std::max (latest, front.capture);
  const bool starting =
      std::ranges::any_of (cameras, [] (const auto &camera) { return !camera->info; });
  bool any = false;
  for (const auto &front : fronts.list) {
    const bool gap = gstrange::is_gap (front.buffer);
    if (!gap && !starting && latest - front.capture <= tolerance)
      continue;
    GstAggregatorPad *pad = cameras[front.camera]->aggregator_pad ();
    if (!gap && starting)
      GST_CAT_DEBUG_OBJECT (category, pad, "dropping image: another camera has no caps yet");
    else if (!gap)
      GST_CAT_DEBUG_OBJECT (category, pad,
          "dropping image: captured %.1f ms before the newest, tolerance %.1f ms",
          double (latest - front.capture) / GST_MSECOND, double (tolerance) / GST_MSECOND);
    gst_aggregator_pad_drop_buffer (pad);
    dropped += !gap;
    any = true;
  }
  return any;
}

std::shared_ptr<CalibrationImages>
pop_images (const CameraInputs &cameras, const PadFronts &fronts, guint64 number)
{
  auto set = std::make_shared<CalibrationImages> ();
  set->cameras = cameras;
  set->buffers.resize (cameras.size ());
  set->number = number;
  for (const auto &camera : cameras) {
    rangecast::CalibrationCamera described = calibration_camera (camera->pad);
    described.width = camera->info->width;
    described.height = camera->info->height;
    set->described.push_back (std::move (described));
    set->infos.push_back (*camera->info);
  }
  for (const auto &front : fronts.list) {
    set->buffers[front.camera] =
        gst_aggregator_pad_pop_buffer (cameras[front.camera]->aggregator_pad ());
    set->capture = std::max (set->capture, front.capture);
    set->running = std::min (set->running, front.running); /* NONE is the maximum */
  }
  if (!GST_CLOCK_TIME_IS_VALID (set->running))
    set->capture = number * 2 * GST_SECOND; /* unknown: so far apart that no motion is inferred */
  return set;
}
