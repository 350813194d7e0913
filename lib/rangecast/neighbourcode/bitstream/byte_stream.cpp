/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "byte_stream.hpp"

#include <algorithm>
#include <cstring>

namespace rangecast {
namespace {

using Bytes = std::span<const std::uint8_t>;

/* Files are searched in such blocks. */
constexpr std::size_t kBlock = 65536;
/* Bisection ends, and walking begins, when so few bytes are left. */
constexpr std::uint64_t kWalkBytes = 4 * kBlock;
/* Rigs come once a second: walking begins so much earlier that it meets one. */
constexpr std::uint64_t kRigWindow_ns = 2'000'000'000;

enum class End { kSound, kDamaged, kOpen };

/* How far the sizes of units lead through an access unit that is said to end at `told`. */
struct Extent {
  std::size_t end = kStreamPrefixSize;
  End state = End::kSound;
};

Extent
follow_units (Bytes bytes, std::size_t told)
{
  Extent extent;
  while (extent.end < told) {
    const std::size_t left = bytes.size () - std::min (bytes.size (), extent.end);
    const std::size_t said = told - extent.end;
    UnitHeader unit;
    if (left < kUnitHeaderSize && said >= kUnitHeaderSize)
      return {extent.end, End::kOpen};
    const Status status =
        read_unit_header (bytes.subspan (extent.end, std::min (left, said)), unit);
    const bool truncated = status.code () == StatusCode::kTruncated;
    if (truncated && said >= kUnitHeaderSize && unit.size <= said)
      return {extent.end, End::kOpen};
    if (!status.ok ())
      return {extent.end, End::kDamaged};
    extent.end += unit.size;
  }
  return extent;
}

/* The first place from `from` on, before `limit`, where an access unit begins; else `limit`. With
 * `or_candidate` places too near the end to tell count. */
std::size_t
find_access_unit (Bytes bytes, std::size_t from, std::size_t limit, bool or_candidate)
{
  const auto first = bytes.begin ();
  auto at = first + std::ptrdiff_t (std::min (from, bytes.size ()));
  while (true) {
    at = std::search (at, bytes.end (), kStartCode.begin (), kStartCode.end ());
    const auto position = std::size_t (at - first);
    if (at == bytes.end () || position >= limit)
      return limit;
    AccessUnitHeader header;
    const Bytes rest = bytes.subspan (position);
    if (begins_access_unit (rest, header) || (or_candidate && rest.size () < kStreamPrefixSize))
      return position;
    ++at;
  }
}

StreamPart
rubbish (Bytes bytes, bool at_end)
{
  StreamPart part;
  part.rubbish = find_access_unit (bytes, 1, bytes.size (), !at_end);
  /* Half a start code may be at the end. */
  if (part.rubbish == bytes.size () && !at_end)
    part.rubbish -= std::min (bytes.size () - 1, kStartCode.size () - 1);
  return part;
}

/* A start code inside: bytes were lost in front of it, or it is chance. What is at the end that
 * the sizes say decides. */
StreamPart
weigh_inner_start (Bytes bytes, std::size_t inner, std::size_t told, bool at_end, StreamPart part)
{
  AccessUnitHeader next;
  if (bytes.size () < told + kStreamPrefixSize && !at_end)
    part.wanted = told + kStreamPrefixSize;
  else if (begins_access_unit (bytes.subspan (told), next) || bytes.size () == told)
    part.length = told;
  else
    part.length = inner;
  return part;
}

StreamPart
access_unit (Bytes bytes, bool at_end, StreamPart part)
{
  const std::size_t told = kStreamPrefixSize + part.header.size;
  const Extent extent = follow_units (bytes, told);
  if (extent.state == End::kOpen && !at_end) {
    part.wanted = std::min (told, std::max (2 * bytes.size (), kBlock));
    return part;
  }
  std::size_t limit = extent.end;
  if (extent.state == End::kOpen)
    limit = std::min (bytes.size (), told);
  const std::size_t inner = find_access_unit (bytes, kStreamPrefixSize, limit, false);
  if (extent.state == End::kSound && inner < limit)
    return weigh_inner_start (bytes, inner, told, at_end, part);
  part.length = inner;
  return part;
}

} // namespace

bool
begins_access_unit (Bytes bytes, AccessUnitHeader &header)
{
  return bytes.size () >= kStreamPrefixSize &&
         std::memcmp (bytes.data (), kStartCode.data (), kStartCode.size ()) == 0 &&
         read_access_unit_header (bytes.subspan (kStartCode.size (), kAccessUnitHeaderSize), header)
             .ok ();
}

StreamPart
next_part (Bytes bytes, bool at_end)
{
  StreamPart part;
  if (bytes.size () < kStreamPrefixSize && !at_end)
    part.wanted = kStreamPrefixSize;
  else if (begins_access_unit (bytes, part.header))
    part = access_unit (bytes, at_end, part);
  else if (!bytes.empty ())
    part = rubbish (bytes, at_end);
  return part;
}

std::optional<AccessUnitPlace>
StreamFile::at (std::uint64_t offset)
{
  AccessUnitPlace place{offset, {}, false};
  read_ (offset, kStreamPrefixSize + kUnitHeaderSize, block_);
  if (!begins_access_unit (block_, place.header))
    return {};
  UnitHeader unit;
  (void)read_unit_header (
      Bytes (block_).subspan (kStreamPrefixSize), unit); /* it is not all here */
  place.has_rig = unit.type == static_cast<std::uint8_t> (UnitType::kRigView);
  return place;
}

/* The first one from `from` on that begins before `limit`. */
std::optional<AccessUnitPlace>
StreamFile::next (std::uint64_t from, std::uint64_t limit)
{
  if (const auto place = at (from); place && from < limit)
    return place;
  for (; from < limit; from += kBlock) {
    read_ (from, kBlock + kStreamPrefixSize - 1, block_);
    const std::size_t position = find_access_unit (block_, 0, kBlock, false);
    if (position < kBlock && from + position < limit)
      return at (from + position);
  }
  return {};
}

std::optional<AccessUnitPlace>
StreamFile::following (const AccessUnitPlace &place)
{
  const std::uint64_t end = place.offset + kStreamPrefixSize + place.header.size;
  if (end == size_)
    return {};
  if (const auto next_place = at (end))
    return next_place;
  return next (
      place.offset + kStreamPrefixSize, size_); /* its size was damaged, or rubbish comes */
}

std::optional<AccessUnitPlace>
StreamFile::last ()
{
  const std::uint64_t furthest = kMaxAccessUnitSize + 2 * kStreamPrefixSize;
  for (std::uint64_t end = size_; end > 0 && size_ - end < furthest;) {
    const std::uint64_t begin = end - std::min<std::uint64_t> (end, kBlock);
    read_ (begin, kBlock + kStreamPrefixSize - 1, block_);
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

/* An offset not behind the first access unit that is later than `pts_ns`, and near it. */
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
  std::optional<AccessUnitPlace> rig;
  for (auto place = next (from, size_); place; place = following (*place)) {
    const AccessUnitHeader &header = place->header;
    if (header.pts_ns == kNoTime)
      return target;
    if (place->has_rig && header.pts_ns <= pts_ns)
      rig = place;
    if (!header.key)
      continue;
    if (header.pts_ns >= pts_ns)
      target.after = place;
    if (header.pts_ns > pts_ns)
      break;
    target.before = place;
    target.rig = rig;
    if (header.pts_ns == pts_ns)
      break;
  }
  return target;
}

StreamFile::Target
StreamFile::locate (std::uint64_t pts_ns)
{
  constexpr std::uint64_t all = UINT64_MAX;
  for (std::uint64_t window_ns = kRigWindow_ns;; window_ns = std::min (window_ns, all / 4) * 4) {
    const std::uint64_t from = bisect (pts_ns - std::min (pts_ns, window_ns));
    const Target target = walk (from, pts_ns);
    if (target.before || from == 0 || window_ns > all / 4)
      return target;
  }
}

} // namespace rangecast
