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
  if (Status s = depth_.set (view, settings.depth_bits); !s.ok ())
    return s;
  colour_ = ColourQuantiser (settings.colour_bits);
  plain_.set_codes (depth_, colour_);
  view_ = view;
  settings_ = settings;
  configured_ = true;
  return {};
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
  header.frame_number = frame_number;
  header.capture_time_ns = image.capture_time_ns;
  if (roi.empty ()) {
    to.resize (to.size () + kSliceHeaderSize);
    write_slice_header (header, kSliceHeaderSize, to.data () + to.size () - kSliceHeaderSize);
    result.slices++;
    return {};
  }
  header.roi = roi;
  if (settings_.profile == Profile::kPlain) {
    const PlainSettings plain = {
        settings_.depth_threshold, settings_.colour_threshold, settings_.max_slice_size};
    const PlainResult done = plain_.encode (image, plain, header, to);
    result.slices += done.slices;
    result.full_pixels += done.full_pixels;
    add_points (done.points, roi, result);
  } else {
    const CompactSettings compact = {settings_.depth_threshold, settings_.colour_threshold,
        settings_.max_slice_size, settings_.choice == NeighbourChoice::kBest};
    const CompactResult done = compact_.encode (image, {depth_, colour_}, compact, header, to);
    result.slices += done.slices;
    result.full_pixels += done.full_pixels;
    add_points (count_points (image), roi, result);
  }
  return {};
}

std::uint64_t
ViewEncoder::count_points (const ConstRangeImage &image) const
{
  std::uint64_t points = 0;
  for (int y = 0; y < image.roi.height; y++) {
    const std::uint16_t *row = image.depth.row (y);
    for (int x = 0; x < image.roi.width; x++)
      points += depth_.valid (row[x]);
  }
  return points;
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
