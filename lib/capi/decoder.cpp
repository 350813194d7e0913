/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "decoder.hpp"

#include <algorithm>

using rangecast::kAccessUnitHeaderSize;
using rangecast::kNoTime;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::StreamPart;

namespace {

/* A stream that begins with more that is no access unit is something else. */
constexpr std::size_t kMaxLeadingGarbage = 2 << 20;
/* Bytes that are read at a time, at least. */
constexpr std::size_t kBlock = 256 << 10;

/* @return why such a rig is not used; empty if it is */
std::string
limit_exceeded (const rangecast::Rig &rig)
{
  if (rig.views.size () > rangecast::kMaxDecoderViews)
    return "The rig has " + std::to_string (rig.views.size ()) + " views; the limit is " +
           std::to_string (rangecast::kMaxDecoderViews) + ".";
  for (const rangecast::View &view : rig.views)
    if (std::max (view.width, view.height) > rangecast::kMaxDecoderSide)
      return "View " + std::to_string (view.id) + " has " + std::to_string (view.width) + "x" +
             std::to_string (view.height) + " pixels; the limit is " +
             std::to_string (rangecast::kMaxDecoderSide) + " each way.";
  return {};
}

} // namespace

RangecastResult
RangecastDecoder::fail (std::string_view message, RangecastResult result)
{
  message_ = message;
  return result;
}

void
RangecastDecoder::drop_frame_set ()
{
  pending_.clear ();
  images_.clear ();
  const std::uint64_t number = frame_set_.number;
  frame_set_ = {};
  frame_set_.number = number;
}

void
RangecastDecoder::reset ()
{
  collector_.reset ();
  used_generation_ = 0;
  has_rig_ = false;
  refusal_.clear ();
  decoder_.reset_references ();
  drop_frame_set ();
  has_stream_ = false;
  stream_ = {};
}

void
RangecastDecoder::push_units (Bytes units)
{
  has_stream_ = false;
  add_units (units);
}

void
RangecastDecoder::add_units (Bytes units)
{
  rangecast::UnitReader reader (units);
  rangecast::UnitHeader header;
  while (const auto unit = reader.next (header)) {
    if (header.type == static_cast<std::uint8_t> (rangecast::UnitType::kRigView)) {
      if (const Status status = collector_.add (*unit); status.code () == StatusCode::kBadSize)
        refusal_ = "The rig is too large: " + status.message () + ".";
    } else if (pending_.size () + unit->size () <= rangecast::kMaxAccessUnitSize) {
      pending_.insert (pending_.end (), unit->begin (), unit->end ());
    }
  }
  if (reader.status ().code () == StatusCode::kUnsupported)
    refusal_ = "The stream cannot be read: " + reader.status ().message () + ".";
}

/* @return false if there is none, or it is beyond the limits */
bool
RangecastDecoder::use_rig ()
{
  if (collector_.generation () == used_generation_)
    return has_rig_;
  used_generation_ = collector_.generation ();
  refusal_ = limit_exceeded (collector_.info ().rig);
  images_.clear ();
  frame_set_.n_views = 0;
  has_rig_ = refusal_.empty ();
  if (!has_rig_)
    return false;
  if (const Status status = decoder_.set_rig (collector_.info ().rig); !status.ok ()) {
    refusal_ = status.message ();
    has_rig_ = false;
  }
  rig_number_++;
  return has_rig_;
}

/* Images for the views that were planned. @return false if they are too large */
bool
RangecastDecoder::make_images ()
{
  images_.clear ();
  std::uint64_t pixels = 0;
  for (const auto &view : decoder_.views ())
    pixels +=
        static_cast<std::uint64_t> (view.roi.width) * static_cast<std::uint64_t> (view.roi.height);
  if (pixels > rangecast::kMaxDecoderPixels)
    return false;
  for (const auto &view : decoder_.views ()) {
    const int width = view.roi.width, height = view.roi.height;
    Planes &planes = memory_[images_.size ()];
    const auto size = static_cast<std::size_t> (width) * static_cast<std::size_t> (height);
    planes.depth.resize (size);
    planes.colour.resize (size);
    images_.push_back ({view.view_id, view.roi, {planes.depth.data (), width, height, 2 * width},
        {planes.colour.data (), width, height, 4 * width}, view.capture_time_ns});
  }
  return true;
}

/* Decodes the units that were pushed. */
RangecastResult
RangecastDecoder::decode (std::uint64_t time)
{
  if (!use_rig ()) {
    pending_.clear ();
    return refusal_.empty () ? RANGECAST_NOTHING : fail (refusal_);
  }
  if (pending_.empty ())
    return RANGECAST_NOTHING;
  rangecast::DecoderResult result;
  frame_set_.number++; /* images change even where memory runs out */
  decoder_.plan (pending_, result, false);
  Status status;
  const bool fits = make_images ();
  if (fits)
    status = decoder_.decode (images_, threads_, result);
  frame_set_ = {0, static_cast<std::uint32_t> (images_.size ()), frame_set_.number, time,
      images_.empty () ? 0 : images_[0].capture_time_ns, pending_.size (), result.points,
      result.slices, result.bad_slices, result.missing_pixels, result.unknown_pixels};
  pending_.clear ();
  if (!fits)
    return fail ("A frame set has more than " + std::to_string (rangecast::kMaxDecoderPixels) +
                 " pixels, the limit.");
  return status.ok () ? RANGECAST_OK : fail (status.message ());
}

/* ---- byte streams ---- */

void
RangecastDecoder::Stream::skip (std::size_t n)
{
  begin += n;
  at += n;
  wanted = 0;
}

/* Reads until the buffer has `wanted` bytes, or the file ends. */
bool
RangecastDecoder::Stream::fill (std::size_t wanted)
{
  const std::size_t held = buffer.size () - begin;
  const auto more = static_cast<std::size_t> (
      std::min<std::uint64_t> (size - end (), std::max (wanted, held + kBlock) - held));
  buffer.erase (buffer.begin (), buffer.begin () + std::ptrdiff_t (begin));
  begin = 0;
  buffer.resize (held + more);
  const std::size_t got = read (user_data, at + held, buffer.data () + held, more);
  buffer.resize (held + std::min (got, more));
  return got == more;
}

rangecast::StreamFile
RangecastDecoder::Stream::file () const
{
  const auto read_at = [this] (std::uint64_t offset, std::size_t n, std::vector<std::uint8_t> &to) {
    to.resize (n);
    to.resize (std::min (read (user_data, offset, to.data (), n), n));
  };
  return {read_at, size};
}

RangecastResult
RangecastDecoder::push_bytes (Bytes bytes)
{
  has_stream_ = true;
  if (stream_.read)
    return fail ("A file is open; reset the decoder before bytes are pushed.");
  stream_.size = bytes.empty () ? stream_.end () : UINT64_MAX;
  stream_.buffer.erase (
      stream_.buffer.begin (), stream_.buffer.begin () + std::ptrdiff_t (stream_.begin));
  stream_.begin = 0;
  stream_.buffer.insert (stream_.buffer.end (), bytes.begin (), bytes.end ());
  return RANGECAST_OK;
}

RangecastResult
RangecastDecoder::open (std::uint64_t size, RangecastRead read, void *user_data)
{
  reset ();
  if (!read)
    return fail ("rangecast_decoder_open() needs a function that reads.");
  has_stream_ = true;
  stream_.read = read;
  stream_.user_data = user_data;
  stream_.size = size;
  if (const auto last = stream_.file ().last ())
    stream_.last_ns = last->header.pts_ns;
  return RANGECAST_OK;
}

/* As the element neighbourcodeparse puts it. */
std::string
RangecastDecoder::missing_data () const
{
  if (!refusal_.empty ())
    return refusal_;
  if (!stream_.any_access_unit)
    return stream_.version.empty () ? "This is no recording of gst-rangecast (.rcnc)."
                                    : "The recording cannot be read: " + stream_.version + ".";
  return has_rig_ ? "The recording ends before its first complete frame set."
                  : "The recording has no rig, which says where its cameras stand.";
}

RangecastResult
RangecastDecoder::decode_part (const StreamPart &part)
{
  const std::uint64_t pts = part.header.pts_ns;
  stream_.any_access_unit = true;
  if (stream_.first_ns == kNoTime)
    stream_.first_ns = pts;
  add_units (stream_.bytes ().subspan (kAccessUnitHeaderSize, part.length - kAccessUnitHeaderSize));
  const bool timed = pts != kNoTime && pts >= stream_.first_ns;
  const RangecastResult result = decode (timed ? pts - stream_.first_ns : RANGECAST_NO_TIME);
  stream_.any_frame_set |= result == RANGECAST_OK;
  return result;
}

RangecastResult
RangecastDecoder::next_of_stream ()
{
  Stream &s = stream_;
  while (true) {
    const bool at_end = s.end () >= s.size;
    if (!at_end && s.bytes ().size () < s.wanted) {
      if (!s.read)
        return RANGECAST_NOTHING;
      if (!s.fill (s.wanted))
        return fail ("The recording can no longer be read.", RANGECAST_FATAL);
    }
    const StreamPart part = rangecast::next_part (s.bytes (), s.end () >= s.size);
    s.wanted = part.wanted;
    if (part.wanted)
      continue;
    if (part.expected)
      s.ending = "The recording is cut off: its last frame set has " +
                 std::to_string (part.length + part.garbage) + " of " +
                 std::to_string (part.expected) + " bytes.";
    if (part.expected && s.any_frame_set) {
      s.skip (part.length + part.garbage); /* it has a part of the person only */
    } else if (part.length) {
      const RangecastResult result = decode_part (part);
      s.skip (part.length);
      if (result != RANGECAST_NOTHING)
        return result;
    } else if (part.garbage) {
      /* The access units of another version have the same magic. */
      rangecast::AccessUnitHeader header;
      if (const Status status = rangecast::read_access_unit_header (s.bytes (), header);
          s.at == 0 && status.code () == StatusCode::kUnsupported)
        s.version = status.message ();
      s.garbage += s.any_access_unit ? 0 : part.garbage;
      s.skip (part.garbage);
      if (s.garbage > kMaxLeadingGarbage)
        return fail (missing_data (), RANGECAST_FATAL);
    } else if (s.any_frame_set) {
      message_ = s.ending;
      return RANGECAST_END;
    } else {
      return fail (missing_data (), RANGECAST_FATAL);
    }
  }
}

RangecastResult
RangecastDecoder::seek (std::uint64_t time)
{
  if (!stream_.read || stream_.first_ns == kNoTime)
    return RANGECAST_NOTHING;
  const std::uint64_t span = kNoTime - 1 - stream_.first_ns;
  const auto target = stream_.file ().locate (stream_.first_ns + std::min (time, span));
  const auto &place = target.before ? target.before : target.after;
  if (!place)
    return RANGECAST_NOTHING;
  stream_.at = place->offset;
  stream_.buffer.clear ();
  stream_.begin = stream_.wanted = 0;
  stream_.ending.clear ();
  discontinuity ();
  return RANGECAST_OK;
}

/* ---- output ---- */

RangecastStream
RangecastDecoder::stream () const
{
  const rangecast::StreamInfo &info = collector_.info ();
  const bool timed = stream_.first_ns != kNoTime && stream_.last_ns != kNoTime &&
                     stream_.last_ns >= stream_.first_ns;
  return {0, static_cast<std::uint32_t> (has_rig_ ? rig ()->views.size () : 0),
      info.fps_n > 0 ? std::uint64_t{1'000'000'000} * static_cast<std::uint64_t> (info.fps_d) /
                           static_cast<std::uint64_t> (info.fps_n)
                     : 0,
      timed ? stream_.last_ns - stream_.first_ns : RANGECAST_NO_TIME};
}

std::span<const rangecast::BlendPlanes>
RangecastDecoder::planes ()
{
  if (planes_of_ != frame_set_.number) {
    std::vector<rangecast::SurfaceView> views;
    for (const auto &image : images_)
      views.push_back ({image, rig ()->find (image.view_id)});
    planes_.resize (std::max (planes_.size (), views.size ()));
    for (std::size_t i = 0; i < views.size (); i++)
      rangecast::make_blend_planes (views, i, rangecast::StripSettings ().depth_step, planes_[i]);
    planes_of_ = frame_set_.number;
  }
  return std::span (planes_).first (images_.size ());
}
