/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frames.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>

using rangecast::StatusCode;

static constexpr GstClockTime kDefaultTolerance = 5 * GST_MSECOND;

CalibrationPictures::~CalibrationPictures ()
{
  for (GstBuffer *buffer : buffers)
    if (buffer)
      gst_buffer_unref (buffer);
}

MappedCalibrationPictures::MappedCalibrationPictures (CalibrationPictures &pictures)
    : views (pictures.sources.size ())
{
  for (std::size_t i = 0; i < pictures.sources.size () && status.ok (); i++)
    if (pictures.buffers[i])
      open (pictures, i);
}

MappedCalibrationPictures::~MappedCalibrationPictures ()
{
  for (CalibrationSource *source : open_)
    source->reader.close ();
}

void
MappedCalibrationPictures::open (CalibrationPictures &pictures, std::size_t i)
{
  CalibrationSource &source = *pictures.sources[i];
  if (!source.reader_set || !gst_video_info_is_equal (&source.reader_info, &pictures.infos[i])) {
    source.reader_info = pictures.infos[i];
    source.reader_set = source.reader.set (pictures.infos[i]);
  }
  const std::string &name = pictures.described[i].name;
  if (!source.reader_set)
    status = {StatusCode::kUnsupported, "pad " + name + ": cannot convert the images to RGBx"};
  else if (!source.reader.open (pictures.buffers[i]))
    status = {StatusCode::kBadData, "pad " + name + ": a buffer is smaller than its caps require"};
  else {
    open_.push_back (&source);
    views[i] = source.reader.view ();
  }
}

CalibrationFronts::CalibrationFronts (const CalibrationSources &sources, bool live)
{
  for (std::size_t i = 0; i < sources.size (); i++) {
    GstAggregatorPad *pad = sources[i]->aggregator_pad ();
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad);
    if (buffer)
      list.push_back ({i, buffer, gstrange::capture_time_of (pad, buffer, live),
          gstrange::running_time_of (pad, buffer)});
    else
      (gst_aggregator_pad_is_eos (pad) ? ended : missing)++;
  }
}

CalibrationFronts::~CalibrationFronts ()
{
  for (const Front &front : list)
    gst_buffer_unref (front.buffer);
}

GstClockTime
calibration_tolerance (const CalibrationSources &sources, GstClockTime max_skew)
{
  if (max_skew > 0)
    return max_skew;
  GstClockTime shortest = GST_CLOCK_TIME_NONE;
  for (const auto &source : sources)
    if (source->has_info && source->info.fps_n > 0)
      shortest = std::min (
          shortest, gst_util_uint64_scale_int (GST_SECOND, source->info.fps_d, source->info.fps_n));
  return GST_CLOCK_TIME_IS_VALID (shortest) ? shortest / 2 : kDefaultTolerance;
}

bool
drop_unmatched (const CalibrationSources &sources, const CalibrationFronts &fronts,
    GstClockTime tolerance, guint64 &dropped)
{
  GstClockTime latest = 0;
  for (const auto &front : fronts.list)
    if (!gstrange::is_gap (front.buffer))
      latest = std::max (latest, front.capture);
  const bool early =
      std::ranges::any_of (sources, [] (const auto &source) { return !source->has_info; });
  bool any = false;
  for (const auto &front : fronts.list) {
    const bool gap = gstrange::is_gap (front.buffer);
    if (!gap && !early && latest - front.capture <= tolerance)
      continue;
    gst_aggregator_pad_drop_buffer (sources[front.source]->aggregator_pad ());
    dropped += !gap;
    any = true;
  }
  return any;
}

std::shared_ptr<CalibrationPictures>
take_pictures (const CalibrationSources &sources, const CalibrationFronts &fronts, guint64 number)
{
  auto pictures = std::make_shared<CalibrationPictures> ();
  pictures->sources = sources;
  pictures->buffers.resize (sources.size ());
  pictures->number = number;
  for (const auto &source : sources) {
    rangecast::CalibrationCamera described = calibration_camera (source->pad);
    described.width = source->info.width;
    described.height = source->info.height;
    pictures->described.push_back (std::move (described));
    pictures->infos.push_back (source->info);
  }
  for (const auto &front : fronts.list) {
    pictures->buffers[front.source] =
        gst_aggregator_pad_pop_buffer (sources[front.source]->aggregator_pad ());
    pictures->capture = std::max (pictures->capture, front.capture);
    pictures->running = std::min (pictures->running, front.running); /* NONE is the greatest */
  }
  if (!GST_CLOCK_TIME_IS_VALID (pictures->running))
    pictures->capture = number * 2 * GST_SECOND; /* says nothing about motion */
  return pictures;
}
