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

/** Presentation time of an access unit that has none. */
inline constexpr std::uint64_t kNoTime = UINT64_MAX;

/** Whether `bytes` begins with a sound access-unit unit. */
bool begins_access_unit (std::span<const std::uint8_t> bytes, AccessUnitHeader &header);

/** The beginning of some bytes of the stream: one of the three sizes is not 0. */
struct StreamPart {
  std::size_t garbage = 0; ///< bytes before the place where an access unit may begin next
  std::size_t length = 0;  ///< bytes of the access unit, access-unit unit included
  std::size_t wanted = 0;  ///< bytes needed, from the same beginning, to call next_part() again
  AccessUnitHeader header; ///< of the access unit
  /** Bytes that the last part should have from the same beginning, if the stream ends within an
   *  access unit or its header; else 0. */
  std::size_t expected = 0;
};

/** Separates access units from garbage. An access unit has the size that its header declares if the
 *  sizes of its units agree with that; what looks like another one inside a unit is ignored then.
 *  Otherwise it ends at the next one or, if there is none, after the last readable unit, so that a
 *  damaged size does not make the reader wait for megabytes. `wanted` doubles, which keeps the work
 *  for an access unit that arrives in small parts linear.
 *  @param at_end  no more bytes will follow; `wanted` is then always 0 */
StreamPart next_part (std::span<const std::uint8_t> bytes, bool at_end);

/** An access unit in a file. */
struct AccessUnitPlace {
  std::uint64_t offset = 0; ///< bytes, of its access-unit unit
  AccessUnitHeader header;
  bool has_rig = false; ///< rig views precede its slices; not read from files
};

/** The times at which a byte stream plays: from 0, and without a gap where its times go back at a
 * rig, as in recordings joined by `cat`. */
class StreamTimes {
public:
  struct Time {
    std::uint64_t time_ns;
    bool goes_back; ///< the access unit's time, which the stream's does not
  };
  /** The time of the next access unit, which has one in the stream.
   *  @param frame_ns  from the last access unit before times go back to the next one */
  Time next (const AccessUnitPlace &unit, std::uint64_t frame_ns);
  /** The next access unit was sought: its time counts from the stream's first one. */
  void seek ();
  /** Another byte stream begins, a frame after the last access unit. */
  void begin_stream ()
  {
    first_ns_.reset ();
    follows_ = false;
  }
  /** Presentation time of the first access unit of the stream. */
  [[nodiscard]] std::optional<std::uint64_t> first_ns () const { return first_ns_; }

private:
  std::optional<std::uint64_t> first_ns_;
  std::uint64_t origin_ns_ = 0;             /* a presentation time */
  std::uint64_t origin_at_ns_ = 0;          /* and when that plays */
  std::uint64_t last_ = 0, before_ = 0;     /* presentation times of the last two access units */
  bool follows_ = false;                    /* the next access unit follows these */
  std::optional<std::uint64_t> last_at_ns_; /* when the last one plays */
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
