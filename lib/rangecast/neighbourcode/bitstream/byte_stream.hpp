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
/** Takes that a list holds. */
inline constexpr std::size_t kMaxTakes = 4096;
/** Files up to this size, bytes, are searched for takes access unit by access unit. */
inline constexpr std::uint64_t kWalkFile = 8 << 20;

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
  bool has_rig = false; ///< rig views precede its slices
};

/** One of the recordings that a byte stream holds, one after another. */
struct Take {
  std::uint64_t offset = 0;  ///< bytes, of its first access unit
  std::uint64_t pts_ns = 0;  ///< of that one, in the file
  std::uint64_t time_ns = 0; ///< of that one, on the time line of the whole stream
};

/** The time line of a byte stream, on which each take follows the one before it. A take begins at a
 *  rig whose time is not later than the two before it. Of more than kMaxTakes takes, a new one
 *  replaces the one before: that one's times are then unknown, but not those of the first takes. */
class TakeList {
public:
  struct Time {
    std::uint64_t time_ns;
    bool begins_take; ///< and is not the stream's first one
  };
  /** Adds the next access unit, which has a time. The first one has time 0.
   *  @param frame_ns  from the last access unit of a take to the next take */
  Time add (const AccessUnitPlace &unit, std::uint64_t frame_ns);
  /** The next access unit does not follow the one before, as after a seek. */
  void interrupt () { current_ = kNone; }
  /** Another byte stream begins, a frame after the last access unit. Offsets begin anew. */
  void begin_stream ();

  [[nodiscard]] bool empty () const { return takes_.empty (); }
  [[nodiscard]] const std::vector<Take> &takes () const { return takes_; }
  /** Index of the take of the access unit at an offset; the list is not empty. */
  [[nodiscard]] std::size_t index_at (std::uint64_t offset) const;
  /** Time of an access unit; not before its take begins. The list is not empty. */
  [[nodiscard]] std::uint64_t time_of (std::uint64_t offset, std::uint64_t pts_ns) const;

private:
  static constexpr std::size_t kNone = SIZE_MAX;

  [[nodiscard]] bool goes_back (const AccessUnitPlace &unit) const;
  void insert (const AccessUnitPlace &unit, std::uint64_t frame_ns);

  std::vector<Take> takes_;        /* by offset */
  std::size_t current_ = kNone;    /* take of the last access unit */
  std::uint64_t last_ = 0;         /* presentation times of the last access unit */
  std::uint64_t before_ = 0;       /* and of the one before it */
  std::uint64_t last_time_ns_ = 0; /* of the last access unit */
  bool resumes_ = false;           /* another byte stream came before */
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

  /** The takes from an offset on: all of a file of up to 8 MiB; in a longer one, by bisection,
   * those that are at least a 32nd of it and a few of the shorter ones. Empty if there are no
   * times.
   *  @param walk_size  instead of the 8 MiB */
  TakeList takes (std::uint64_t begin, std::uint64_t frame_ns, std::uint64_t walk_size = kWalkFile);

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
  AccessUnitPlace last_not_before (const AccessUnitPlace &from, const AccessUnitPlace &to);
  void search_takes (const AccessUnitPlace &from, const AccessUnitPlace &to, std::uint64_t frame_ns,
      TakeList &list);
  void walk_takes (AccessUnitPlace place, std::uint64_t to, std::uint64_t frame_ns, TakeList &list);

  Read read_;
  std::uint64_t size_;
  std::vector<std::uint8_t> block_;
};

} // namespace rangecast
