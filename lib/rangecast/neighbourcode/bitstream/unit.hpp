/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The units of a coded stream. The format is specified in docs/formats/bitstream.md. */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "../../base/status.hpp"
#include "../../geometry/range_image.hpp"
#include "../../geometry/rig.hpp"

namespace rangecast {

inline constexpr int kBitstreamVersion = 4;
inline constexpr std::size_t kUnitHeaderSize = 4;
inline constexpr std::size_t kSliceHeaderSize = 36; ///< of key slices, with the unit header
inline constexpr std::size_t kMaxUnitSize = 65535;

enum class UnitType : std::uint8_t {
  kSlice = 1,      ///< some rows of one view's ROI
  kRigView = 2,    ///< one view of the rig
  kAccessUnit = 3, ///< begins an access unit
};

/** The first bytes of every unit. Readers skip units of unknown types by their size. */
struct UnitHeader {
  std::uint8_t version = kBitstreamVersion; ///< 1 to 15
  std::uint8_t type = 0;                    ///< a UnitType, or an unknown one
  std::uint8_t flags = 0;
  std::uint16_t size = 0; ///< bytes of the whole unit, this header included
};

enum class Profile : std::uint8_t {
  kPlain = 0,   ///< codes of fixed length
  kPacked = 1,  ///< run lengths and fixed prefix codes
  kEntropy = 2, ///< adaptive frequencies and rANS
};

/** The header of a slice. */
struct SliceHeader {
  bool key = true;        ///< decodes without any earlier frame set
  bool reference = false; ///< later frame sets may refer to the pixels of this one
  std::uint8_t view_id = 0;
  Profile profile = Profile::kPlain;
  std::uint8_t depth_bits = 0;    ///< 6 to 16
  std::uint8_t colour_bits = 0;   ///< 4 to 8, of each of R, G, B
  std::uint32_t frame_number = 0; ///< counts the encoder's frame sets
  std::uint64_t capture_time_ns = 0;
  Roi roi;                           ///< the view's whole ROI, in its full image
  int first_row = 0, rows = 0;       ///< of the ROI
  int first_column = 0, columns = 0; ///< of the ROI
  /** The slice refers to frame set frame_number - reference_distance; 1 to 255, or 0 in key slices.
   */
  std::uint8_t reference_distance = 0;
};

/** Bytes of a slice's header. */
constexpr std::size_t
header_size_of (const SliceHeader &header)
{
  return kSliceHeaderSize + !header.key;
}

/** Reads the header of the unit that `bytes` begins with.
 *  @return kTruncated if the unit is longer than `bytes`, kBadData if its size is impossible,
 *  kUnsupported if it is of another version */
Status read_unit_header (std::span<const std::uint8_t> bytes, UnitHeader &header);

/** Reads and checks the header of a slice unit: everything but its symbols. */
Status read_slice_header (std::span<const std::uint8_t> unit, SliceHeader &header);
/** Writes a slice header of header_size_of() bytes; the unit is `unit_size` bytes long. */
void write_slice_header (const SliceHeader &header, std::size_t unit_size, std::uint8_t *to);

/** Iterates over the units of an access unit. */
class UnitReader {
public:
  explicit UnitReader (std::span<const std::uint8_t> bytes) : rest_ (bytes) {}
  /** The next unit, or nothing at the end or at damage (see status()). */
  std::optional<std::span<const std::uint8_t>> next (UnitHeader &header);
  [[nodiscard]] const Status &status () const { return status_; }

private:
  std::span<const std::uint8_t> rest_;
  Status status_;
};

/** The contents of a stream's rig-view units. */
struct StreamInfo {
  Rig rig;
  int fps_n = 0, fps_d = 1; ///< frame rate; 0/1 = unknown
};

/** Appends one rig-view unit for each view. None is longer than 500 bytes for range views. */
void write_rig_units (const StreamInfo &info, std::vector<std::uint8_t> &to);

/** Collects rig-view units, in any order and with repetitions, until all views are present. */
class RigCollector {
public:
  void reset () { *this = RigCollector (); }
  /** Adds a rig-view unit. @return kBadData or kUnsupported for a damaged one, kBadSize for one
   * that makes the rig larger than kMaxRigPixels; both are ignored */
  Status add (std::span<const std::uint8_t> unit);
  /** Incremented whenever a complete rig differs from the one before; 0: none was complete so far.
   */
  [[nodiscard]] unsigned generation () const { return generation_; }
  [[nodiscard]] const StreamInfo &info () const { return info_; }

private:
  Status update_if_complete ();

  std::array<std::optional<View>, kMaxViews> views_;
  std::array<std::vector<std::uint8_t>, kMaxViews> units_; /* of views_: they often come again */
  int total_ = 0, fps_n_ = 0, fps_d_ = 1;
  unsigned generation_ = 0;
  StreamInfo info_;
};

/** The access-unit unit. */
struct AccessUnitHeader {
  std::uint32_t size = 0;   ///< bytes of the units that follow it in the same access unit
  std::uint64_t pts_ns = 0; ///< presentation time; UINT64_MAX = none
  std::uint64_t capture_time_ns = 0;
  bool key = true;
};
inline constexpr std::size_t kAccessUnitHeaderSize = 28;
/** Greatest size of an access unit, bytes. */
inline constexpr std::uint32_t kMaxAccessUnitSize = 32u << 20;
/** Greatest number of slices of an access unit. Readers ignore those beyond, because short slices
 * take several times their size in memory. */
inline constexpr std::size_t kMaxSlices = std::size_t{1} << 17;

/** @return kUnsupported only for the access-unit unit of another version, or with unknown flags */
Status read_access_unit_header (std::span<const std::uint8_t> unit, AccessUnitHeader &header);
void write_access_unit_header (const AccessUnitHeader &header, std::uint8_t *to);

} // namespace rangecast
