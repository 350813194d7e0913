/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

namespace rangecast {

Status
validate (const EncoderSettings &s)
{
  const auto bad = [] (const char *what) { return Status{StatusCode::kBadValue, what}; };
  if (s.depth_bits < 6 || s.depth_bits > 16)
    return bad ("encoder: depth bits, expected 6 to 16");
  if (s.colour_bits < 4 || s.colour_bits > 8)
    return bad ("encoder: colour bits, expected 4 to 8");
  if (s.depth_threshold < 0 || s.depth_threshold > 65535 || s.colour_threshold < 0 ||
      s.colour_threshold > 255)
    return bad ("encoder: thresholds, expected 0 to 65535 for depth and 0 to 255 for colour");
  if (s.max_slice_size < 256 || s.max_slice_size > int (kMaxUnitSize))
    return bad ("encoder: maximum slice size, expected 256 to 65535 bytes");
  if (s.profile > Profile::kEntropy)
    return bad ("encoder: profile, expected plain, packed or entropy");
  if (s.depth_scale > DepthScale::kInverse)
    return bad ("encoder: depth scale, expected linear or inverse");
  return {};
}

Status
ViewEncoder::configure (const View &view, const EncoderSettings &settings)
{
  const bool same_view = configured_ && encode_rig ({{view}}) == encode_rig ({{view_}});
  if (same_view && settings == settings_)
    return {};
  if (Status s = validate (settings); !s.ok ())
    return s;
  const bool same_codes = same_view && settings.depth_bits == settings_.depth_bits &&
                          settings.depth_scale == settings_.depth_scale &&
                          settings.colour_bits == settings_.colour_bits;
  if (!same_codes) {
    if (Status s = depth_.set (view, settings.depth_bits, settings.depth_scale); !s.ok ())
      return s;
    colour_ = ColourQuantiser (settings.colour_bits);
    plain_.set_codes (depth_, colour_);
  }
  const bool comparable = same_codes && settings.profile == settings_.profile && settings.temporal;
  if (!same_view) {
    refresh_.reset (view.height, view.id);
    compact_.set_size (view.width, view.height);
  }
  if (!comparable) {
    references_.forget ();
    reference_choice_.reset (refresh_.bands ());
  }
  view_ = view;
  settings_ = settings;
  configured_ = true;
  return {};
}

/* Of the ROI in a band. */
static std::size_t
pixels_of (const RowBand &band, const Roi &roi)
{
  return static_cast<std::size_t> (band.rows) * static_cast<std::size_t> (roi.width);
}

SliceHeader
ViewEncoder::make_header (const ConstRangeImage &image, std::uint32_t frame_number) const
{
  SliceHeader header;
  header.view_id = static_cast<std::uint8_t> (view_.id);
  header.depth_bits = static_cast<std::uint8_t> (settings_.depth_bits);
  header.colour_bits = static_cast<std::uint8_t> (settings_.colour_bits);
  header.profile = settings_.profile;
  header.inverse_depth = settings_.depth_scale == DepthScale::kInverse;
  header.frame_number = frame_number;
  header.capture_time_ns = image.capture_time_ns;
  return header;
}

/* Begins to keep the coded pixels, if later frame sets are to refer to them, and plans which rows
 * refer to the frame set before. */
CodingReference
ViewEncoder::plan_references (SliceHeader &header)
{
  fine_.clear ();
  both_.clear ();
  coarse_.assign (1, {0, header.roi.height, true, 0});
  if (!settings_.temporal)
    return {};
  header.reference = true;
  references_.begin (header);
  const ReferencePlane &before = references_.before ();
  const std::uint32_t distance = header.frame_number - before.frame_number ();
  const bool key = !before.held () || distance == 0 || distance > 255;
  header.reference_distance = key ? std::uint8_t{0} : static_cast<std::uint8_t> (distance);
  refresh_.plan (header.roi,
      {header.capture_time_ns, settings_.frame_interval_ns, settings_.refresh_period_ns}, key,
      bands_);
  reference_choice_.sort (bands_, fine_, coarse_, both_);
  return {&before, references_.now_kept ()};
}

/* Appends the slices of some bands. @return what they came to, but for raw_bits */
EncoderResult
ViewEncoder::code_bands (const Frame &frame, std::span<const RowBand> bands, bool fine)
{
  const auto result_of = [] (const auto &done) {
    return EncoderResult{done.points, done.full_pixels, done.slices, done.delta_slices, 0};
  };
  const auto &[image, header, reference, to] = frame;
  const int depth = settings_.depth_threshold, colour = settings_.colour_threshold;
  const int size = settings_.max_slice_size;
  if (settings_.profile != Profile::kPlain)
    return result_of (compact_.encode (image, bands, reference, {depth_, colour_},
        {depth, colour, size, settings_.choice == NeighbourChoice::kBest, fine}, header, to));
  const PlainSettings plain = {depth, colour, size};
  return result_of (reference.now ? plain_temporal_.encode (
                                        image, bands, reference, depth_, colour_, plain, header, to)
                                  : plain_.encode (image, plain, header, to));
}

/* Codes the bands for which a reference pays, and notes what each came to. */
EncoderResult
ViewEncoder::code_fine_bands (const Frame &frame)
{
  const std::size_t begin = frame.to.size ();
  const EncoderResult result = code_bands (frame, fine_, true);
  UnitReader units (std::span (frame.to).subspan (begin));
  UnitHeader unit;
  SliceHeader slice;
  costs_.assign (fine_.size (), 0);
  while (const auto bytes = units.next (unit)) {
    (void)read_slice_header (*bytes, slice);
    for (std::size_t i = 0; i < fine_.size (); i++)
      if (slice.first_row >= fine_[i].first_row &&
          slice.first_row < fine_[i].first_row + fine_[i].rows)
        costs_[i] += bytes->size ();
  }
  for (std::size_t i = 0; i < fine_.size (); i++)
    reference_choice_.coded (fine_[i], {costs_[i], pixels_of (fine_[i], frame.image.roi)});
  return result;
}

/* Codes a band with a reference and without one, and keeps the smaller. */
EncoderResult
ViewEncoder::code_both_ways (const Frame &frame, RowBand band)
{
  std::vector<std::uint8_t> &to = frame.to;
  const std::size_t begin = to.size ();
  std::size_t bytes[2] = {};
  const auto code = [&] (bool key) {
    const std::size_t before = to.size ();
    band.key = key;
    const EncoderResult result = code_bands (frame, {&band, 1}, !key);
    bytes[key] = to.size () - before;
    return result;
  };
  /* What is coded last is what later frame sets refer to. */
  const bool expects_key = !reference_choice_.expects_delta (band);
  (void)code (!expects_key);
  EncoderResult result = code (expects_key);
  const bool takes_key = bytes[true] <= bytes[false];
  if (takes_key == expects_key) {
    to.erase (to.begin () + std::ptrdiff_t (begin),
        to.begin () + std::ptrdiff_t (begin + bytes[!expects_key]));
  } else {
    to.resize (begin);
    result = code (takes_key);
  }
  reference_choice_.tried (band, bytes[false], {bytes[true], pixels_of (band, frame.image.roi)});
  return result;
}

Status
ViewEncoder::encode (const ConstRangeImage &image, std::uint32_t frame_number,
    std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const Roi &roi = image.roi;
  if (!configured_)
    return {StatusCode::kBadValue, "encoder: not configured"};
  if (!roi.empty () && (roi.x < 0 || roi.y < 0 || roi.x + roi.width > view_.width ||
                           roi.y + roi.height > view_.height))
    return {StatusCode::kBadSize,
        "view " + std::to_string (view_.id) + ": the ROI does not lie in the view's image"};
  Frame frame = {image, make_header (image, frame_number), {}, to};
  if (roi.empty ()) {
    references_.forget (); /* as if it were absent */
    to.resize (to.size () + kSliceHeaderSize);
    write_slice_header (frame.header, kSliceHeaderSize, to.data () + to.size () - kSliceHeaderSize);
    result.slices++;
    return {};
  }
  frame.header.roi = roi;
  frame.reference = plan_references (frame.header);
  EncoderResult done;
  for (const RowBand &band : both_)
    done += code_both_ways (frame, band);
  if (!fine_.empty ())
    done += code_fine_bands (frame);
  if (!coarse_.empty ())
    done += code_bands (frame, coarse_, false);
  done.raw_bits =
      done.points * static_cast<std::uint64_t> (settings_.depth_bits + 3 * settings_.colour_bits) +
      static_cast<std::uint64_t> (roi.width) * static_cast<std::uint64_t> (roi.height);
  result += done;
  return {};
}

} // namespace rangecast
