/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "concealment.hpp"

#include <algorithm>

using rangecast::AccessUnitDecoder;
using rangecast::DecoderResult;
using rangecast::RangeImage;
using rangecast::Rig;
using rangecast::Roi;
using rangecast::Status;
using rangecast::View;

namespace {

/* Pixels are not repeated across a longer jump in time, nor views for longer. */
constexpr GstClockTime kMaxAge = GST_SECOND;

bool
is_soon_after (GstClockTime now, GstClockTime then)
{
  return GST_CLOCK_TIME_IS_VALID (now) && GST_CLOCK_TIME_IS_VALID (then) && now >= then &&
         now - then <= kMaxAge;
}

const RangeImage *
find (std::span<const RangeImage> images, int view_id)
{
  const auto found = std::ranges::find (images, view_id, &RangeImage::view_id);
  return found == images.end () ? nullptr : &*found;
}

Roi
united (const Roi &a, const Roi &b)
{
  if (a.empty () || b.empty ())
    return a.empty () ? b : a;
  const int x = std::min (a.x, b.x), y = std::min (a.y, b.y);
  return {x, y, std::max (a.x + a.width, b.x + b.width) - x,
      std::max (a.y + a.height, b.y + b.height) - y};
}

/* The part of an image that is a ROI inside its own. */
RangeImage
part_of (const RangeImage &image, const Roi &roi)
{
  RangeImage part = image;
  part.roi = roi;
  if (roi.empty ())
    return {image.view_id, {}, {}, {}, image.capture_time_ns};
  const int x = roi.x - image.roi.x, y = roi.y - image.roi.y;
  part.depth = image.depth.crop (x, y, roi.width, roi.height);
  part.colour = image.colour.crop (x, y, roi.width, roi.height);
  return part;
}

} // namespace

void
Concealment::reset ()
{
  gst_clear_buffer (&last_);
  skips_ = false;
  jump_ = GST_CLOCK_TIME_NONE;
}

/* Recordings repeat their rig; a damaged copy makes another rig for a while. */
void
Concealment::set_rig (const Rig &before, const Rig &now)
{
  const auto shows_alike = [] (const View &a, const View &b) {
    return a.id == b.id && a.width == b.width && a.height == b.height &&
           a.depth_unit_m == b.depth_unit_m;
  };
  if (!std::ranges::equal (before.views, now.views, shows_alike))
    reset ();
}

/* DISCONT comes with every lost packet, when the last pixels are needed most; they are too old only
 * where the time jumps. If the next frame set does not continue from the jump, that time was
 * damaged. */
GstBuffer *
Concealment::begin (GstBuffer *input)
{
  now_ = GST_BUFFER_PTS (input);
  skips_ = false;
  if (!GST_CLOCK_TIME_IS_VALID (now_) && GST_BUFFER_IS_DISCONT (input))
    reset ();
  if (!last_)
    return nullptr;
  const bool goes_on = is_soon_after (now_, GST_BUFFER_PTS (last_));
  if (goes_on || (!GST_BUFFER_IS_DISCONT (input) && !GST_CLOCK_TIME_IS_VALID (jump_))) {
    jump_ = GST_CLOCK_TIME_NONE;
    return last_;
  }
  if (is_soon_after (now_, jump_)) {
    reset ();
    return nullptr;
  }
  skips_ = true;
  jump_ = now_;
  return nullptr;
}

Status
Concealment::add_views (
    const AccessUnitDecoder &decoder, std::span<const RangeImage> older, GstBuffer *buffer)
{
  std::uint64_t there = 0;
  for (std::size_t i = 0; i < decoder.views ().size (); i++) {
    const auto &view = decoder.views ()[i];
    const RangeImage *shown = find (older, view.view_id);
    /* A ROI of which most is missing may itself be damaged, or that of a stray slice. */
    const bool adds = shown && 2 * decoder.missing_pixels (i) > view.coded_pixels;
    const Roi roi = adds ? united (view.roi, shown->roi) : view.roi;
    if (Status s = gstrange::add_view (buffer, view.view_id, roi, view.capture_time_ns); !s.ok ())
      return s;
    there |= std::uint64_t{1} << view.view_id;
    if (!skips_) /* else the time of the frame set is that of a jump and may be damaged */
      last_seen_[std::size_t (view.view_id)] = now_;
  }
  for (const RangeImage &image : older)
    if (!(there >> image.view_id & 1) &&
        is_soon_after (now_, last_seen_[std::size_t (image.view_id)]))
      if (Status s = gstrange::add_view (buffer, image.view_id, image.roi, image.capture_time_ns);
          !s.ok ())
        return s;
  return {};
}

Status
Concealment::decode (AccessUnitDecoder &decoder, std::span<const RangeImage> images,
    std::span<const RangeImage> older, int threads, DecoderResult &result)
{
  std::array<RangeImage, rangecast::kMaxViews> parts;
  const auto planned = decoder.views ();
  for (std::size_t i = 0; i < images.size (); i++) {
    const bool whole = i < planned.size () && images[i].roi == planned[i].roi;
    if (!whole)
      if (const RangeImage *shown = find (older, images[i].view_id))
        rangecast::fill_from (*shown, images[i]);
    if (i < planned.size ())
      parts[i] = whole ? images[i] : part_of (images[i], planned[i].roi);
  }
  return decoder.decode (std::span (parts).first (planned.size ()), threads, result, older);
}

/* Our reference makes the buffer unwritable: downstream copies it before it writes. */
void
Concealment::keep (GstBuffer *output)
{
  if (!skips_)
    gst_buffer_replace (&last_, output);
}
