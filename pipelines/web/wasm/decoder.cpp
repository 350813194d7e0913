/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <array>
#include <memory>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/surface/view_fit.hpp>
#include <vector>

#include "border.hpp"

using rangecast::DecoderResult;
using rangecast::RangeImage;
using rangecast::Rgbx;
using rangecast::Rig;
using rangecast::Status;
using rangecast::View;

namespace {

using Bytes = std::span<const std::uint8_t>;

/* The largest message: an access unit of a byte stream. */
constexpr std::size_t kMaxInput = rangecast::kMaxAccessUnitSize + rangecast::kAccessUnitHeaderSize;

std::vector<std::uint8_t> input_bytes;
std::string message;
/* They go on counting when the stream is forgotten. */
unsigned frame_sets = 0, rigs = 0;

/* @return why the page does not show such a rig; empty if it does */
std::string
limit_exceeded (const Rig &rig)
{
  if (rig.views.size () > web::kMaxViews)
    return "The rig has " + std::to_string (rig.views.size ()) +
           " views; the browser shows at most " + std::to_string (web::kMaxViews) + ".";
  for (const View &view : rig.views)
    if (std::max (view.width, view.height) > web::kMaxSide)
      return "View " + std::to_string (view.id) + " has " + std::to_string (view.width) + "x" +
             std::to_string (view.height) + " pixels; the browser shows at most " +
             std::to_string (web::kMaxSide) + " each way.";
  return {};
}

class Decoder {
public:
  void add (Bytes units);
  web::Outcome decode (std::uint64_t pts_ns);
  void forget_references () { decoder_.reset_references (); }
  [[nodiscard]] bool has_rig () const { return has_rig_; }
  [[nodiscard]] const std::string &refusal () const { return refusal_; }
  [[nodiscard]] const rangecast::StreamInfo &info () const { return collector_.info (); }
  [[nodiscard]] web::FrameSet frame_set () const
  {
    return {images_, &decoder_.rig (), pts_ns_, number_, rig_number_};
  }
  [[nodiscard]] const DecoderResult &result () const { return result_; }
  [[nodiscard]] std::uint64_t bytes () const { return bytes_; }

private:
  struct Planes {
    std::vector<std::uint16_t> depth;
    std::vector<Rgbx> colour;
  };
  bool use_rig ();
  bool make_images ();

  rangecast::RigCollector collector_;
  unsigned used_generation_ = 0;
  bool has_rig_ = false;
  std::string refusal_;
  rangecast::AccessUnitDecoder decoder_;
  std::vector<std::uint8_t> pending_; /* units of the next frame set */
  std::array<Planes, web::kMaxViews> planes_;
  std::vector<RangeImage> images_;
  DecoderResult result_;
  std::uint64_t bytes_ = 0; /* of the last frame set */
  std::uint64_t pts_ns_ = rangecast::kNoPts;
  unsigned number_ = 0, rig_number_ = 0;
};

void
Decoder::add (Bytes units)
{
  rangecast::UnitReader reader (units);
  rangecast::UnitHeader header;
  while (const auto unit = reader.next (header)) {
    if (header.type == static_cast<std::uint8_t> (rangecast::UnitType::kRigView)) {
      if (const Status status = collector_.add (*unit);
          status.code () == rangecast::StatusCode::kBadSize)
        refusal_ = "The rig is too large: " + status.message () + ".";
    } else if (pending_.size () + unit->size () <= rangecast::kMaxAccessUnitSize) {
      pending_.insert (pending_.end (), unit->begin (), unit->end ());
    }
  }
  if (reader.status ().code () == rangecast::StatusCode::kUnsupported)
    refusal_ = "The stream cannot be read: " + reader.status ().message () + ".";
}

/* @return false if there is none, or it is beyond the limits */
bool
Decoder::use_rig ()
{
  if (collector_.generation () == used_generation_)
    return has_rig_;
  used_generation_ = collector_.generation ();
  refusal_ = limit_exceeded (collector_.info ().rig);
  images_.clear ();
  has_rig_ = refusal_.empty ();
  if (!has_rig_)
    return false;
  if (const Status status = decoder_.set_rig (collector_.info ().rig); !status.ok ()) {
    refusal_ = status.message ();
    has_rig_ = false;
  }
  rig_number_ = ++rigs;
  return has_rig_;
}

/* Images for the views that were planned. @return false if they are too large */
bool
Decoder::make_images ()
{
  images_.clear ();
  std::uint64_t pixels = 0;
  for (const auto &view : decoder_.views ())
    pixels +=
        static_cast<std::uint64_t> (view.roi.width) * static_cast<std::uint64_t> (view.roi.height);
  if (pixels > web::kMaxPixels)
    return false;
  for (const auto &view : decoder_.views ()) {
    const int width = view.roi.width, height = view.roi.height;
    Planes &planes = planes_[images_.size ()];
    const auto size = static_cast<std::size_t> (width) * static_cast<std::size_t> (height);
    planes.depth.resize (size);
    planes.colour.resize (size);
    images_.push_back ({view.view_id, view.roi, {planes.depth.data (), width, height, 2 * width},
        {planes.colour.data (), width, height, 4 * width}, view.capture_time_ns});
  }
  return true;
}

web::Outcome
Decoder::decode (std::uint64_t pts_ns)
{
  if (!use_rig ()) {
    pending_.clear ();
    return refusal_.empty () ? web::kNothing : web::fail (refusal_);
  }
  if (pending_.empty ())
    return web::kNothing;
  result_ = {};
  bytes_ = pending_.size ();
  decoder_.plan (pending_, result_, false);
  Status status;
  const bool fits = make_images ();
  if (fits)
    status = decoder_.decode (images_, 1, result_);
  pending_.clear ();
  pts_ns_ = pts_ns;
  number_ = ++frame_sets;
  if (!fits)
    return web::fail ("A frame set has more than " + std::to_string (web::kMaxPixels) +
                      " pixels, the most that the browser shows.");
  return status.ok () ? web::kDone : web::fail (status.message ());
}

std::unique_ptr<Decoder> &
slot ()
{
  static auto made = std::make_unique<Decoder> ();
  return made;
}

Decoder &
decoder ()
{
  return *slot ();
}

} // namespace

namespace web {

Bytes
input (std::uint32_t size)
{
  return size <= input_bytes.size () ? Bytes (input_bytes).first (size) : Bytes ();
}

void
set_message (std::string_view text)
{
  message = text;
}

Outcome
fail (std::string_view text)
{
  set_message (text);
  return kFailed;
}

void
add_units (Bytes units)
{
  decoder ().add (units);
}

Outcome
decode (std::uint64_t pts_ns)
{
  return decoder ().decode (pts_ns);
}

void
forget_references ()
{
  decoder ().forget_references ();
}

void
forget_stream ()
{
  slot () = std::make_unique<Decoder> ();
}

bool
has_rig ()
{
  return decoder ().has_rig ();
}

const std::string &
refusal ()
{
  return decoder ().refusal ();
}

std::uint64_t
frame_duration_ns ()
{
  const auto &info = decoder ().info ();
  return info.fps_n > 0 ? std::uint64_t{1'000'000'000} * static_cast<std::uint64_t> (info.fps_d) /
                              static_cast<std::uint64_t> (info.fps_n)
                        : 0;
}

FrameSet
frame_set ()
{
  return decoder ().frame_set ();
}

} // namespace web

/* ---- exported ---- */

/** Memory for `size` bytes of input, until the next call; nullptr if that is more than any message
 *  has. */
RC_EXPORT (rc_input) std::uint8_t *rc_input (std::uint32_t size)
{
  if (size > kMaxInput)
    return nullptr;
  if (input_bytes.size () < size)
    input_bytes.resize (size);
  return input_bytes.data ();
}

/** The sentence of the last failure, UTF-8, ending with a 0. */
RC_EXPORT (rc_message) const char *rc_message ()
{
  return message.c_str ();
}

/** Adds whole units from the input: an access unit, or one or more slices of it. */
RC_EXPORT (rc_add_units) void rc_add_units (std::uint32_t size)
{
  web::add_units (web::input (size));
}

/** Decodes the units that were added as one frame set. @return Outcome */
RC_EXPORT (rc_decode) std::int32_t rc_decode ()
{
  return web::decode (rangecast::kNoPts);
}

RC_EXPORT (rc_forget_references) void rc_forget_references ()
{
  web::forget_references ();
}

RC_EXPORT (rc_forget_stream) void rc_forget_stream ()
{
  web::forget_stream ();
}

/** @return a record: views, PTS (ms; -1: none), capture time (ms), bytes, and DecoderResult's
 *  slices, bad slices, missing pixels, unknown pixels, points */
RC_EXPORT (rc_frame) const double *rc_frame ()
{
  static double record[9];
  const web::FrameSet set = web::frame_set ();
  const DecoderResult &result = decoder ().result ();
  const double values[] = {double (set.images.size ()),
      set.pts_ns == rangecast::kNoPts ? -1 : double (set.pts_ns) / 1e6,
      set.images.empty () ? 0 : double (set.images[0].capture_time_ns) / 1e6,
      double (decoder ().bytes ()), double (result.slices), double (result.bad_slices),
      double (result.missing_pixels), double (result.unknown_pixels), double (result.points)};
  std::copy (std::begin (values), std::end (values), record);
  return record;
}

/** @return a record of a decoded view: view-id, ROI x, y, width, height, addresses of the depth
 *  plane (uint16, depth units) and the colour plane (RGBx), both without padding between rows;
 *  nullptr if there is none */
RC_EXPORT (rc_view) const double *rc_view (std::uint32_t index)
{
  static double record[7];
  const auto images = web::frame_set ().images;
  if (index >= images.size ())
    return nullptr;
  const RangeImage &image = images[index];
  const double values[] = {double (image.view_id), double (image.roi.x), double (image.roi.y),
      double (image.roi.width), double (image.roi.height),
      double (reinterpret_cast<std::uintptr_t> (image.depth.data)),
      double (reinterpret_cast<std::uintptr_t> (image.colour.data))};
  std::copy (std::begin (values), std::end (values), record);
  return record;
}

/** Number of views of the rig; 0: there is no rig yet. */
RC_EXPORT (rc_rig_views) std::uint32_t rc_rig_views ()
{
  return web::has_rig () ? std::uint32_t (web::frame_set ().rig->views.size ()) : 0;
}

/** @return a record of a view of the rig: view-id, width, height; nullptr if there is none */
RC_EXPORT (rc_rig_view) const double *rc_rig_view (std::uint32_t index)
{
  static double record[3];
  if (index >= rc_rig_views ())
    return nullptr;
  const View &view = web::frame_set ().rig->views[index];
  record[0] = view.id;
  record[1] = view.width;
  record[2] = view.height;
  return record;
}

/** The frame set as a PLY file. @return a record: address, bytes; nullptr, with a message, if there
 *  is no frame set */
RC_EXPORT (rc_ply) const double *rc_ply ()
{
  static std::vector<std::uint8_t> file;
  static double record[2];
  const web::FrameSet set = web::frame_set ();
  const rangecast::PointCloudWriter writer ({});
  std::size_t points = 0;
  for (const RangeImage &image : set.images)
    points += rangecast::count_points (image);
  if (points == 0) {
    web::fail ("There is nothing to save.");
    return nullptr;
  }
  file.resize (writer.size (points));
  if (const Status status = writer.write (set.images, *set.rig, file); !status.ok ()) {
    web::fail (status.message ());
    return nullptr;
  }
  record[0] = double (reinterpret_cast<std::uintptr_t> (file.data ()));
  record[1] = double (file.size ());
  return record;
}
