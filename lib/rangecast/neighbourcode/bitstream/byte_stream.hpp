/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Finds access units in the byte stream that files hold. The format: docs/formats/bitstream.md. */
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "unit.hpp"

namespace rangecast {

/** Bytes before the units of an access unit: its start code and its access-unit unit. */
inline constexpr std::size_t kStreamPrefixSize = kStartCode.size () + kAccessUnitHeaderSize;
/** Presentation time of an access unit that has none. */
inline constexpr std::uint64_t kNoTime = UINT64_MAX;

/** Whether `bytes` begins with a start code and a sound access-unit unit. */
bool begins_access_unit (std::span<const std::uint8_t> bytes, AccessUnitHeader &header);

/** The beginning of some bytes of the stream: one of the three sizes is not 0. */
struct StreamPart {
  std::size_t rubbish = 0; ///< bytes before the place where an access unit may begin next
  std::size_t length = 0;  ///< bytes of the access unit, prefix included
  std::size_t wanted = 0;  ///< bytes needed, from the same beginning, to call next_part() again
  AccessUnitHeader header; ///< of the access unit
  /** Bytes that the last part should have from the same beginning, if the stream ends within an
   *  access unit or its header; else 0. */
  std::size_t expected = 0;
};

/** Separates access units from rubbish. An access unit has the size that its header declares if the
 *  sizes of its units agree with that; start codes inside it are ignored then. Otherwise it ends at
 *  the next start code or, if there is none, after the last readable unit, so that a damaged size
 *  does not make the reader wait for megabytes. `wanted` doubles, which keeps the work for an
 * access unit that arrives in small parts linear.
 *  @param at_end  no more bytes will follow; `wanted` is then always 0 */
StreamPart next_part (std::span<const std::uint8_t> bytes, bool at_end);

/** An access unit in a file. */
struct AccessUnitPlace {
  std::uint64_t offset = 0; ///< bytes, of its start code
  AccessUnitHeader header;
  bool has_rig = false; ///< rig views precede its slices
};

/** Finds access units by time in a file without reading all of it. */
class StreamFile {
public:
  /** Reads up to `size` bytes at `offset`; fewer at the end, none on failure. */
  using Read =
      std::function<void (std::uint64_t offset, std::size_t size, std::vector<std::uint8_t> &to)>;

  StreamFile (Read read, std::uint64_t size) : read_ (std::move (read)), size_ (size) {}

  /** The last access unit. */
  std::optional<AccessUnitPlace> last ();

  struct Target {
    std::optional<AccessUnitPlace> before; ///< the last key one not later than the time
    std::optional<AccessUnitPlace> after;  ///< the first key one not earlier than the time
    std::optional<AccessUnitPlace> rig;    ///< the last one with a rig up to `before`
  };
  /** Key access units around a presentation time, by bisection; nothing if they have no times. */
  Target locate (std::uint64_t pts_ns);

private:
  std::optional<AccessUnitPlace> at (std::uint64_t offset);
  std::optional<AccessUnitPlace> next (std::uint64_t from, std::uint64_t limit);
  std::optional<AccessUnitPlace> following (const AccessUnitPlace &place);
  std::uint64_t bisect (std::uint64_t pts_ns);
  Target walk (std::uint64_t from, std::uint64_t pts_ns);

  Read read_;
  std::uint64_t size_;
  std::vector<std::uint8_t> block_;
};

} // namespace rangecast
