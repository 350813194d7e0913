/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "byte_stream.hpp"

#include <algorithm>

namespace rangecast {
namespace {

using Bytes = std::span<const std::uint8_t>;

/* Files are searched in such blocks. */
constexpr std::size_t kBlock = 65536;
/* Bisection ends and linear search begins when so few bytes are left. */
constexpr std::uint64_t kWalkBytes = 4 * kBlock;
/* Linear search begins so much earlier, where a key access unit should be. */
constexpr std::uint64_t kKeyWindow_ns = 2'000'000'000;

/* Of an access-unit unit: version and type. */
constexpr auto kFirstByte =
    std::uint8_t (kBitstreamVersion << 4 | static_cast<int> (UnitType::kAccessUnit));

enum class End { kSound, kDamaged, kOpen };

/* How far the sizes of units lead through an access unit whose declared end is `declared`. Another
 * access unit does not belong to it. */
struct Extent {
  std::size_t end = kAccessUnitHeaderSize;
  End state = End::kSound;
};

Extent
follow_units (Bytes bytes, std::size_t declared)
{
  Extent extent;
  while (extent.end < declared) {
    const std::size_t left = bytes.size () - std::min (bytes.size (), extent.end);
    const std::size_t rest = declared - extent.end;
    UnitHeader unit;
    AccessUnitHeader next;
    if (left < kUnitHeaderSize && rest >= kUnitHeaderSize)
      return {extent.end, End::kOpen};
    if (begins_access_unit (bytes.subspan (extent.end), next))
      return {extent.end, End::kDamaged};
    const Status status =
        read_unit_header (bytes.subspan (extent.end, std::min (left, rest)), unit);
    const bool truncated = status.code () == StatusCode::kTruncated;
    if (truncated && rest >= kUnitHeaderSize && unit.size <= rest)
      return {extent.end, End::kOpen};
    if (!status.ok ())
      return {extent.end, End::kDamaged};
    extent.end += unit.size;
  }
  return extent;
}

/* The first position from `from` on, before `limit`, where an access unit begins; else `limit`.
 * With `or_candidate` positions too near the end to be certain count, too. */
std::size_t
find_access_unit (Bytes bytes, std::size_t from, std::size_t limit, bool or_candidate)
{
  const Bytes searched = bytes.first (std::min (limit, bytes.size ()));
  for (std::size_t at = from; at < searched.size (); at++) {
    const Bytes rest = searched.subspan (at);
    at += std::size_t (std::ranges::find (rest, kFirstByte) - rest.begin ());
    const std::size_t left = bytes.size () - at;
    AccessUnitHeader header;
    if (at < searched.size () && ((or_candidate && left < kAccessUnitHeaderSize) ||
                                     begins_access_unit (bytes.subspan (at), header)))
      return at;
  }
  return limit;
}

/* Whether less than an access-unit unit is left, which can be told from its size and magic. */
bool
is_truncated_header (Bytes bytes)
{
  std::uint8_t sample[kAccessUnitHeaderSize];
  write_access_unit_header ({}, sample);
  constexpr std::size_t begin = 2, end = 8; /* size and magic */
  return bytes.size () >= end && bytes.size () < sizeof sample && bytes[0] == sample[0] &&
         std::equal (sample + begin, sample + end, bytes.begin () + begin);
}

} // namespace

bool
begins_access_unit (Bytes bytes, AccessUnitHeader &header)
{
  return !bytes.empty () && bytes[0] == kFirstByte && read_access_unit_header (bytes, header).ok ();
}

StreamPart
next_part (Bytes bytes, bool at_end)
{
  StreamPart part;
  AccessUnitHeader header, next;
  if (bytes.size () < kAccessUnitHeaderSize && !at_end) {
    part.wanted = kAccessUnitHeaderSize;
    return part;
  }
  if (bytes.empty ())
    return part;
  if (!begins_access_unit (bytes, header)) {
    part.garbage = find_access_unit (bytes, 1, bytes.size (), !at_end);
    if (at_end && part.garbage == bytes.size () && is_truncated_header (bytes))
      part.expected = kAccessUnitHeaderSize;
    return part;
  }
  part.header = header;
  const std::size_t declared = kAccessUnitHeaderSize + header.size;
  const Extent extent = follow_units (bytes, declared);
  if (extent.state == End::kOpen && !at_end) {
    part.wanted = std::min (declared, std::max (2 * bytes.size (), kBlock));
    return part;
  }
  const std::size_t limit =
      extent.state == End::kOpen ? std::min (bytes.size (), declared) : extent.end;
  const std::size_t inner = find_access_unit (bytes, kAccessUnitHeaderSize, limit, false);
  /* One begins inside a unit, though all sizes agree: bytes before it were lost, or it is chance.
   * The bytes after the declared end decide. */
  if (extent.state != End::kSound || inner == limit)
    part.length = inner;
  else if (bytes.size () < declared + kAccessUnitHeaderSize && !at_end)
    part.wanted = declared + kAccessUnitHeaderSize;
  else if (begins_access_unit (bytes.subspan (declared), next) || bytes.size () == declared)
    part.length = declared;
  else
    part.length = inner;
  if (at_end && part.length == bytes.size () && bytes.size () < declared)
    part.expected = declared;
  return part;
}

void
StreamTimes::seek ()
{
  origin_ns_ = first_ns_.value_or (0);
  origin_at_ns_ = 0;
  follows_ = false;
}

/* Times are compared with the one before the last, too, because that of the last may be damaged. */
StreamTimes::Time
StreamTimes::next (const AccessUnitPlace &unit, std::uint64_t frame_ns)
{
  const std::uint64_t pts = unit.header.pts_ns;
  const bool goes_back = follows_ && unit.has_rig && pts <= last_ && pts <= before_;
  const bool begins = goes_back || !first_ns_;
  if (begins) {
    origin_ns_ = pts;
    origin_at_ns_ = last_at_ns_ ? *last_at_ns_ + frame_ns : 0;
  }
  if (!first_ns_)
    first_ns_ = pts;
  before_ = begins ? UINT64_MAX : follows_ ? last_ : 0;
  last_ = pts;
  follows_ = true;
  last_at_ns_ = origin_at_ns_ + (pts - std::min (pts, origin_ns_));
  return {*last_at_ns_, goes_back};
}

std::optional<AccessUnitPlace>
StreamFile::at (std::uint64_t offset)
{
  AccessUnitPlace place{offset, {}, false};
  read_ (offset, kAccessUnitHeaderSize, block_);
  if (!begins_access_unit (block_, place.header))
    return {};
  return place;
}

/* The first one from `from` on that begins before `limit`. */
std::optional<AccessUnitPlace>
StreamFile::next (std::uint64_t from, std::uint64_t limit)
{
  if (const auto place = at (from); place && from < limit)
    return place;
  for (; from < limit; from += kBlock) {
    read_ (from, kBlock + kAccessUnitHeaderSize - 1, block_);
    const std::size_t position = find_access_unit (block_, 0, kBlock, false);
    if (position < kBlock && from + position < limit)
      return at (from + position);
  }
  return {};
}

std::optional<AccessUnitPlace>
StreamFile::following (const AccessUnitPlace &place)
{
  const std::uint64_t end = place.offset + kAccessUnitHeaderSize + place.header.size;
  if (end == size_)
    return {};
  if (const auto next_place = at (end))
    return next_place;
  return next (
      place.offset + kAccessUnitHeaderSize, size_); /* its size was damaged, or garbage comes */
}

std::optional<AccessUnitPlace>
StreamFile::last ()
{
  const std::uint64_t furthest = kMaxAccessUnitSize + 2 * kAccessUnitHeaderSize;
  for (std::uint64_t end = size_; end > 0 && size_ - end < furthest;) {
    const std::uint64_t begin = end - std::min<std::uint64_t> (end, kBlock);
    read_ (begin, kBlock + kAccessUnitHeaderSize - 1, block_);
    const std::size_t none = block_.size ();
    std::size_t found = none;
    for (std::size_t p = 0; (p = find_access_unit (block_, p, none, false)) < none; p++)
      found = p;
    if (found < none)
      return at (begin + found);
    end = begin;
  }
  return {};
}

/* An offset at or shortly before the first access unit that is later than `pts_ns`. */
std::uint64_t
StreamFile::bisect (std::uint64_t pts_ns)
{
  std::uint64_t low = 0, high = size_;
  while (high - low > kWalkBytes) {
    const std::uint64_t middle = low + (high - low) / 2;
    const auto place = next (middle, high);
    if (place && place->header.pts_ns <= pts_ns) /* one without a time counts as too late */
      low = place->offset;
    else
      high = middle;
  }
  return low;
}

StreamFile::Target
StreamFile::walk (std::uint64_t from, std::uint64_t pts_ns)
{
  Target target;
  for (auto place = next (from, size_); place; place = following (*place)) {
    const AccessUnitHeader &header = place->header;
    if (header.pts_ns == kNoTime)
      return target;
    if (!header.key)
      continue;
    if (header.pts_ns >= pts_ns)
      target.after = place;
    if (header.pts_ns > pts_ns)
      break;
    target.before = place;
    if (header.pts_ns == pts_ns)
      break;
  }
  return target;
}

StreamFile::Target
StreamFile::locate (std::uint64_t pts_ns)
{
  constexpr std::uint64_t all = UINT64_MAX;
  for (std::uint64_t window_ns = kKeyWindow_ns;; window_ns = std::min (window_ns, all / 4) * 4) {
    const std::uint64_t from = bisect (pts_ns - std::min (pts_ns, window_ns));
    const Target target = walk (from, pts_ns);
    if (target.before || from == 0 || window_ns > all / 4)
      return target;
  }
}

} // namespace rangecast
