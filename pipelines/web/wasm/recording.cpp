/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Recordings: byte streams that JavaScript reads for us. */
#include <algorithm>
#include <cmath>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/surface/view_fit.hpp>
#include <vector>

#include "border.hpp"

using rangecast::kAccessUnitHeaderSize;
using rangecast::StreamFile;
using rangecast::StreamPart;

/** Reads up to `size` bytes at `offset`; fewer only at the end. @return their number */
extern "C" __attribute__ ((import_module ("rangecast"), import_name ("read"))) std::uint32_t
rc_read (double offset, std::uint32_t size, std::uint8_t *to);

namespace {

/* A file that begins with more that is no access unit is something else. */
constexpr std::size_t kMaxLeadingGarbage = 2 << 20;
/* Bytes that are read at a time, at least. */
constexpr std::size_t kBlock = 256 << 10;

struct Recording {
  double size = 0;      /* bytes */
  std::uint64_t at = 0; /* offset of what `buffer` holds from `begin` on */
  std::vector<std::uint8_t> buffer;
  std::size_t begin = 0, garbage = 0;
  bool any_access_unit = false, any_frame_set = false;
  std::uint64_t first_ns = rangecast::kNoTime, last_ns = rangecast::kNoTime;
  std::string ending;  /* how it is cut off; empty: it is not */
  std::string version; /* why its beginning cannot be read */

  [[nodiscard]] std::span<const std::uint8_t> bytes () const
  {
    return std::span (buffer).subspan (begin);
  }
  [[nodiscard]] std::uint64_t end () const { return at + bytes ().size (); }
  [[nodiscard]] bool at_end () const { return double (end ()) >= size; }
};

Recording *recording = nullptr;

StreamFile
stream_file ()
{
  const auto read = [] (std::uint64_t offset, std::size_t size, std::vector<std::uint8_t> &to) {
    to.resize (size);
    to.resize (std::min<std::size_t> (
        rc_read (double (offset), static_cast<std::uint32_t> (size), to.data ()), size));
  };
  return {read, static_cast<std::uint64_t> (recording->size)};
}

/* Reads until the buffer has `wanted` bytes, or the file ends. */
bool
fill (std::size_t wanted)
{
  Recording &r = *recording;
  const std::size_t held = r.buffer.size () - r.begin;
  const double left = r.size - double (r.end ());
  const auto more =
      static_cast<std::size_t> (std::min (left, double (std::max (wanted, held + kBlock) - held)));
  r.buffer.erase (r.buffer.begin (), r.buffer.begin () + std::ptrdiff_t (r.begin));
  r.begin = 0;
  r.buffer.resize (held + more);
  const std::uint32_t got =
      rc_read (double (r.at + held), static_cast<std::uint32_t> (more), r.buffer.data () + held);
  r.buffer.resize (held + std::min<std::size_t> (got, more));
  return got == more;
}

void
skip (std::size_t size)
{
  recording->begin += size;
  recording->at += size;
}

/* As the element neighbourcodeparse puts it. */
std::string
missing_data ()
{
  const Recording &r = *recording;
  if (!web::refusal ().empty ())
    return web::refusal ();
  if (!r.any_access_unit)
    return r.version.empty () ? "This is no recording of gst-rangecast (.rcnc)."
                              : "The recording cannot be read: " + r.version + ".";
  return web::has_rig () ? "The recording ends before its first complete frame set."
                         : "The recording has no rig, which says where its cameras stand.";
}

/* The access units of another version have the same magic. */
void
look_at_version (std::span<const std::uint8_t> bytes)
{
  rangecast::AccessUnitHeader header;
  const auto status = rangecast::read_access_unit_header (bytes, header);
  if (status.code () == rangecast::StatusCode::kUnsupported)
    recording->version = status.message ();
}

void
note_ending (const StreamPart &part)
{
  if (part.expected)
    recording->ending = "The recording is cut off: its last frame set has " +
                        std::to_string (part.length + part.garbage) + " of " +
                        std::to_string (part.expected) + " bytes.";
}

/* The units of an access unit. */
web::Outcome
decode_part (const StreamPart &part)
{
  Recording &r = *recording;
  const std::uint64_t pts = part.header.pts_ns;
  r.any_access_unit = true;
  if (r.first_ns == rangecast::kNoTime)
    r.first_ns = pts;
  web::add_units (r.bytes ().subspan (kAccessUnitHeaderSize, part.length - kAccessUnitHeaderSize));
  const bool timed = pts != rangecast::kNoTime && pts >= r.first_ns;
  const web::Outcome outcome = web::decode (timed ? pts - r.first_ns : rangecast::kNoPts);
  r.any_frame_set |= outcome == web::kDone;
  return outcome;
}

/* whole: passes over an access unit that is cut off, which has a part of the person only */
web::Outcome
next (bool whole)
{
  Recording &r = *recording;
  while (true) {
    const StreamPart part = rangecast::next_part (r.bytes (), r.at_end ());
    if (part.wanted) {
      if (!fill (part.wanted))
        return web::fail ("The recording can no longer be read.");
      continue;
    }
    note_ending (part);
    if (whole && part.expected && r.any_frame_set) {
      skip (part.length + part.garbage);
    } else if (part.length) {
      const web::Outcome outcome = decode_part (part);
      skip (part.length);
      if (outcome != web::kNothing)
        return outcome;
    } else if (part.garbage) {
      if (r.at == 0)
        look_at_version (r.bytes ());
      r.garbage += r.any_access_unit ? 0 : part.garbage;
      skip (part.garbage);
      if (r.garbage > kMaxLeadingGarbage)
        return web::fail (missing_data ());
    } else if (r.any_frame_set) {
      web::set_message (r.ending);
      return web::kEnd;
    } else {
      return web::fail (missing_data ());
    }
  }
}

void
go_to (std::uint64_t offset)
{
  recording->at = offset;
  recording->buffer.clear ();
  recording->begin = 0;
  recording->ending.clear ();
  web::forget_references ();
}

} // namespace

/** Begins with a recording of so many bytes, which rc_read() reads; forgets the stream before. The
 *  first frame set comes with rc_recording_next(). */
RC_EXPORT (rc_recording_open) void rc_recording_open (double size)
{
  web::forget_stream ();
  delete recording;
  recording = new Recording;
  recording->size = std::isfinite (size) ? std::max (size, 0.0) : 0;
  if (const auto last = stream_file ().last ())
    recording->last_ns = last->header.pts_ns;
}

/** Decodes the next frame set. @param whole  not 0: not one that is cut off at the end, unless it
 *  is the only one. @return Outcome */
RC_EXPORT (rc_recording_next) std::int32_t rc_recording_next (std::int32_t whole)
{
  return recording ? next (whole) : web::fail ("There is no recording.");
}

/** Goes to the last key frame set that is not later than a time. The frame sets from there on may
 *  be earlier than that. @param ms  from the first frame set on. @return kDone; kNothing if the
 *  recording has no times, and stays where it is */
RC_EXPORT (rc_recording_seek) std::int32_t rc_recording_seek (double ms)
{
  if (!recording || recording->first_ns == rangecast::kNoTime || !(ms >= 0))
    return web::kNothing;
  const double span_ns = double (rangecast::kNoTime - 1 - recording->first_ns);
  const auto target = stream_file ().locate (
      recording->first_ns + static_cast<std::uint64_t> (std::min (ms * 1e6, span_ns / 2)));
  const auto &place = target.before ? target.before : target.after;
  if (!place)
    return web::kNothing;
  go_to (place->offset);
  return web::kDone;
}

/** @return a record: duration (ms, from the first to the last frame set; -1: unknown), frame
 *  duration (ms; 0: unknown), share of the file that has been read; nullptr if there is none */
RC_EXPORT (rc_recording) const double *rc_recording ()
{
  static double record[3];
  if (!recording)
    return nullptr;
  const Recording &r = *recording;
  const bool timed = r.first_ns != rangecast::kNoTime && r.last_ns != rangecast::kNoTime &&
                     r.last_ns >= r.first_ns;
  record[0] = timed ? double (r.last_ns - r.first_ns) / 1e6 : -1;
  record[1] = double (web::frame_duration_ns ()) / 1e6;
  record[2] = r.size > 0 ? double (r.at) / r.size : 1;
  return record;
}
