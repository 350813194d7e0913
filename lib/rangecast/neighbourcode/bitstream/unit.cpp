/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "unit.hpp"

#include <algorithm>

namespace rangecast {
namespace {

constexpr std::uint8_t kKeyFlag = 1, kReferenceFlag = 4;
constexpr std::size_t kRigViewHeaderSize = kUnitHeaderSize + 10;
/* Follows the unit header of access-unit units, so that readers find them in damaged streams. */
constexpr std::array<std::uint8_t, 4> kMagic = {0x00, 0x52, 0x43, 0x55};

template <typename T>
T
get (const std::uint8_t *from)
{
  T value = 0;
  for (std::size_t i = 0; i < sizeof (T); i++)
    value |= static_cast<T> (static_cast<T> (from[i]) << (8 * i));
  return value;
}

template <typename T>
void
put (std::uint8_t *to, T value)
{
  for (std::size_t i = 0; i < sizeof (T); i++)
    to[i] = static_cast<std::uint8_t> (value >> (8 * i));
}

void
put_unit_header (std::uint8_t *to, UnitType type, std::uint8_t flags, std::size_t size)
{
  to[0] = static_cast<std::uint8_t> (kBitstreamVersion << 4 | static_cast<int> (type));
  to[1] = flags;
  put (to + 2, static_cast<std::uint16_t> (size));
}

Status
expect_type (std::span<const std::uint8_t> unit, UnitType type, std::size_t minimum,
    const char *name, int flags = kKeyFlag)
{
  UnitHeader header;
  if (Status s = read_unit_header (unit, header); !s.ok ())
    return s;
  if (header.type != static_cast<std::uint8_t> (type) || header.size < minimum)
    return {StatusCode::kBadData,
        std::string (name) + ": unexpected unit type, or shorter than its header"};
  if (header.flags & ~flags)
    return {StatusCode::kUnsupported, std::string (name) + ": reserved flags are set"};
  return {};
}

bool
inside (const SliceHeader &h)
{
  const Roi &roi = h.roi;
  if (roi.empty ())
    return h.key && roi == Roi{} && h.rows == 0 && h.columns == 0 && h.first_row == 0 &&
           h.first_column == 0;
  return roi.x + roi.width <= kMaxImageSide && roi.y + roi.height <= kMaxImageSide && h.rows > 0 &&
         h.columns > 0 && h.first_row + h.rows <= roi.height &&
         h.first_column + h.columns <= roi.width;
}

} // namespace

Status
read_unit_header (std::span<const std::uint8_t> bytes, UnitHeader &header)
{
  if (bytes.size () < kUnitHeaderSize)
    return {StatusCode::kTruncated, "unit: shorter than its header of 4 bytes"};
  header.version = bytes[0] >> 4;
  header.type = bytes[0] & 15;
  header.flags = bytes[1];
  header.size = get<std::uint16_t> (&bytes[2]);
  if (header.version != kBitstreamVersion)
    return {StatusCode::kUnsupported, "bitstream version " + std::to_string (header.version) +
                                          " is not supported, only version " +
                                          std::to_string (kBitstreamVersion)};
  if (header.size < kUnitHeaderSize)
    return {StatusCode::kBadData, "unit: its size is less than its header"};
  if (header.size > bytes.size ())
    return {StatusCode::kTruncated, "unit: truncated"};
  return {};
}

Status
read_slice_header (std::span<const std::uint8_t> unit, SliceHeader &h)
{
  if (Status s = expect_type (
          unit, UnitType::kSlice, kSliceHeaderSize, "slice", kKeyFlag | kReferenceFlag);
      !s.ok ())
    return s;
  const std::uint8_t *p = unit.data ();
  h.key = p[1] & kKeyFlag;
  h.reference = p[1] & kReferenceFlag;
  h.view_id = p[4];
  h.profile = Profile{p[5]};
  h.depth_bits = p[6];
  h.colour_bits = p[7];
  h.frame_number = get<std::uint32_t> (p + 8);
  h.capture_time_ns = get<std::uint64_t> (p + 12);
  h.roi = {get<std::uint16_t> (p + 20), get<std::uint16_t> (p + 22), get<std::uint16_t> (p + 24),
      get<std::uint16_t> (p + 26)};
  h.first_row = get<std::uint16_t> (p + 28);
  h.rows = get<std::uint16_t> (p + 30);
  h.first_column = get<std::uint16_t> (p + 32);
  h.columns = get<std::uint16_t> (p + 34);
  if (h.profile > Profile::kEntropy)
    return {StatusCode::kUnsupported, "slice: profile " + std::to_string (p[5])};
  if (h.view_id >= kMaxViews || h.depth_bits < 6 || h.depth_bits > 16 || h.colour_bits < 4 ||
      h.colour_bits > 8)
    return {StatusCode::kBadData, "slice: view-id, depth bits or colour bits out of range"};
  if (h.profile == Profile::kPlain && (!h.key || h.reference))
    return {StatusCode::kBadData, "slice: profile plain has no references"};
  h.reference_distance = 0;
  if (!h.key) {
    if (get<std::uint16_t> (p + 2) <= kSliceHeaderSize || p[kSliceHeaderSize] == 0)
      return {StatusCode::kBadData, "slice: does not say which frame set it refers to"};
    h.reference_distance = p[kSliceHeaderSize];
  }
  if (!inside (h))
    return {StatusCode::kBadData, "slice: rows and columns do not lie in its ROI"};
  return {};
}

void
write_slice_header (const SliceHeader &h, std::size_t unit_size, std::uint8_t *to)
{
  const int flags = (h.key ? kKeyFlag : 0) | (h.reference ? kReferenceFlag : 0);
  put_unit_header (to, UnitType::kSlice, static_cast<std::uint8_t> (flags), unit_size);
  to[4] = h.view_id;
  to[5] = static_cast<std::uint8_t> (h.profile);
  to[6] = h.depth_bits;
  to[7] = h.colour_bits;
  put (to + 8, h.frame_number);
  put (to + 12, h.capture_time_ns);
  const int fields[] = {
      h.roi.x, h.roi.y, h.roi.width, h.roi.height, h.first_row, h.rows, h.first_column, h.columns};
  for (int i = 0; i < 8; i++)
    put (to + 20 + 2 * i, static_cast<std::uint16_t> (fields[i]));
  if (!h.key)
    to[kSliceHeaderSize] = h.reference_distance;
}

std::optional<std::span<const std::uint8_t>>
UnitReader::next (UnitHeader &header)
{
  if (rest_.empty () || !status_.ok ())
    return {};
  status_ = read_unit_header (rest_, header);
  if (!status_.ok ())
    return {};
  const auto unit = rest_.first (header.size);
  rest_ = rest_.subspan (header.size);
  return unit;
}

void
write_rig_units (const StreamInfo &info, std::vector<std::uint8_t> &to)
{
  const std::size_t total = info.rig.views.size ();
  for (std::size_t i = 0; i < total; i++) {
    const std::vector<std::uint8_t> blob = encode_rig ({{info.rig.views[i]}});
    const std::size_t begin = to.size (), size = kRigViewHeaderSize + blob.size ();
    to.resize (begin + size);
    std::uint8_t *p = to.data () + begin;
    put_unit_header (p, UnitType::kRigView, 0, size);
    p[4] = static_cast<std::uint8_t> (i);
    p[5] = static_cast<std::uint8_t> (total);
    put (p + 6, static_cast<std::uint32_t> (info.fps_n));
    put (p + 10, static_cast<std::uint32_t> (info.fps_d));
    std::copy (blob.begin (), blob.end (), p + kRigViewHeaderSize);
  }
}

Status
RigCollector::add (std::span<const std::uint8_t> unit)
{
  if (Status s = expect_type (unit, UnitType::kRigView, kRigViewHeaderSize, "rig view"); !s.ok ())
    return s;
  const int index = unit[4], total = unit[5];
  const auto fps_n = get<std::uint32_t> (&unit[6]), fps_d = get<std::uint32_t> (&unit[10]);
  if (total < 1 || total > kMaxViews || index >= total || fps_n > INT32_MAX || fps_d < 1 ||
      fps_d > INT32_MAX)
    return {StatusCode::kBadData, "rig view: number, total or frame rate out of range"};
  if (views_[index] && std::ranges::equal (unit, units_[index]))
    return {};
  UnitHeader header;
  Rig one;
  if (Status s = read_unit_header (unit, header); !s.ok ())
    return s;
  if (Status s =
          decode_rig (unit.subspan (kRigViewHeaderSize, header.size - kRigViewHeaderSize), one);
      !s.ok ())
    return s;
  if (one.views.size () != 1 || !one.views[0].is_range_view ())
    return {StatusCode::kBadData, "rig view: expected exactly one range view"};
  if (total != total_ || int (fps_n) != fps_n_ || int (fps_d) != fps_d_) {
    views_ = {};
    total_ = total;
    fps_n_ = static_cast<int> (fps_n);
    fps_d_ = static_cast<int> (fps_d);
  }
  views_[index] = std::move (one.views[0]);
  units_[index].assign (unit.begin (), unit.end ());
  return update_if_complete ();
}

Status
RigCollector::update_if_complete ()
{
  StreamInfo info;
  info.fps_n = fps_n_;
  info.fps_d = fps_d_;
  for (int i = 0; i < total_; i++) {
    if (!views_[i])
      return {};
    info.rig.views.push_back (*views_[i]);
  }
  if (Status s = validate (info.rig); s.code () == StatusCode::kBadSize)
    return s;
  else if (!s.ok ()) /* two views with one id: a change that has not arrived completely */
    return {};
  const auto is_of_rate = [this] (const StreamInfo &other) {
    return std::int64_t{fps_n_} * other.fps_d == std::int64_t{other.fps_n} * fps_d_;
  };
  if (generation_ > 0 && is_of_rate (info_) && encode_rig (info.rig) == encode_rig (info_.rig))
    return {};
  info_ = std::move (info);
  generation_++;
  return {};
}

Status
read_access_unit_header (std::span<const std::uint8_t> unit, AccessUnitHeader &h)
{
  if (unit.size () < kAccessUnitHeaderSize ||
      !std::ranges::equal (unit.subspan (kUnitHeaderSize, kMagic.size ()), kMagic))
    return {StatusCode::kBadData, "access unit: shorter than 28 bytes, or without its magic"};
  if (Status s = expect_type (unit, UnitType::kAccessUnit, kAccessUnitHeaderSize, "access unit");
      !s.ok ())
    return s;
  if (get<std::uint16_t> (&unit[2]) != kAccessUnitHeaderSize)
    return {StatusCode::kBadData, "access unit: not of 28 bytes"};
  h.key = unit[1] & kKeyFlag;
  h.size = get<std::uint32_t> (&unit[8]);
  h.pts_ns = get<std::uint64_t> (&unit[12]);
  h.capture_time_ns = get<std::uint64_t> (&unit[20]);
  if (h.size > kMaxAccessUnitSize)
    return {StatusCode::kBadData, "access unit: longer than 32 MiB"};
  return {};
}

void
write_access_unit_header (const AccessUnitHeader &h, std::uint8_t *to)
{
  put_unit_header (to, UnitType::kAccessUnit, h.key ? kKeyFlag : 0, kAccessUnitHeaderSize);
  std::ranges::copy (kMagic, to + kUnitHeaderSize);
  put (to + 8, h.size);
  put (to + 12, h.pts_ns);
  put (to + 20, h.capture_time_ns);
}

} // namespace rangecast
