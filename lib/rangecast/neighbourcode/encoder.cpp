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
  if (Status s = depth_.set (view, settings.depth_bits, settings.depth_scale); !s.ok ())
    return s;
  colour_ = ColourQuantiser (settings.colour_bits);
  plain_.set_codes (depth_, colour_);
  const bool comparable = same_view && settings.depth_bits == settings_.depth_bits &&
                          settings.depth_scale == settings_.depth_scale &&
                          settings.colour_bits == settings_.colour_bits &&
                          settings.profile == settings_.profile && settings.temporal;
  if (!comparable)
    references_.forget ();
  if (!same_view) {
    refresh_.reset (view.height, view.id);
    compact_.set_size (view.width, view.height);
  }
  view_ = view;
  settings_ = settings;
  configured_ = true;
  return {};
}

/* Begins to keep the coded pixels, if later frame sets are to refer to them, and plans which rows
 * refer to the frame set before. */
CodingReference
ViewEncoder::plan_references (SliceHeader &header)
{
  if (!settings_.temporal) {
    bands_.assign (1, {0, header.roi.height, true});
    return {};
  }
  header.reference = true;
  references_.begin (header);
  const ReferencePlane &before = references_.before ();
  const std::uint32_t distance = header.frame_number - before.frame_number ();
  const bool key = !before.held () || distance == 0 || distance > 255;
  header.reference_distance = key ? std::uint8_t{0} : static_cast<std::uint8_t> (distance);
  refresh_.plan (header.roi,
      {header.capture_time_ns, settings_.frame_interval_ns, settings_.refresh_period_ns}, key,
      bands_);
  return {&before, references_.now_kept ()};
}

void
ViewEncoder::encode_compact (const ConstRangeImage &image, SliceHeader header,
    std::vector<std::uint8_t> &to, EncoderResult &result)
{
  const CodingReference reference = plan_references (header);
  const CompactSettings compact = {settings_.depth_threshold, settings_.colour_threshold,
      settings_.max_slice_size, settings_.choice == NeighbourChoice::kBest};
  const CompactResult done =
      compact_.encode (image, bands_, reference, {depth_, colour_}, compact, header, to);
  result.slices += done.slices;
  result.delta_slices += done.delta_slices;
  result.full_pixels += done.full_pixels;
  add_points (done.points, image.roi, result);
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
  SliceHeader header;
  header.view_id = static_cast<std::uint8_t> (view_.id);
  header.depth_bits = static_cast<std::uint8_t> (settings_.depth_bits);
  header.colour_bits = static_cast<std::uint8_t> (settings_.colour_bits);
  header.profile = settings_.profile;
  header.inverse_depth = settings_.depth_scale == DepthScale::kInverse;
  header.frame_number = frame_number;
  header.capture_time_ns = image.capture_time_ns;
  if (roi.empty ()) {
    references_.forget (); /* as if it were absent */
    to.resize (to.size () + kSliceHeaderSize);
    write_slice_header (header, kSliceHeaderSize, to.data () + to.size () - kSliceHeaderSize);
    result.slices++;
    return {};
  }
  header.roi = roi;
  if (settings_.profile == Profile::kPlain) {
    const PlainSettings plain = {
        settings_.depth_threshold, settings_.colour_threshold, settings_.max_slice_size};
    const CodingReference reference = plan_references (header);
    const PlainResult done = reference.now ? plain_temporal_.encode (image, bands_, reference,
                                                 depth_, colour_, plain, header, to)
                                           : plain_.encode (image, plain, header, to);
    result.slices += done.slices;
    result.delta_slices += done.delta_slices;
    result.full_pixels += done.full_pixels;
    add_points (done.points, roi, result);
  } else {
    encode_compact (image, header, to, result);
  }
  return {};
}

void
ViewEncoder::add_points (std::uint64_t points, const Roi &roi, EncoderResult &result) const
{
  result.points += points;
  result.raw_bits +=
      points * static_cast<std::uint64_t> (settings_.depth_bits + 3 * settings_.colour_bits) +
      static_cast<std::uint64_t> (roi.width) * static_cast<std::uint64_t> (roi.height);
}

} // namespace rangecast
