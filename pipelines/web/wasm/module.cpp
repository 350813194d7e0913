/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What JavaScript needs beside the functions of rangecast.h. */
#include <rangecast/geometry/point_cloud.hpp>
#include <vector>

#include "border.hpp"

/** Reads up to `size` bytes of the recording at `offset`; fewer only at the end. @return their
 *  number */
extern "C" __attribute__ ((import_module ("rangecast"), import_name ("read"))) std::uint32_t
rc_read (double offset, std::uint32_t size, void *to);

namespace {

/* The largest message: an access unit of a byte stream. */
constexpr std::size_t kMaxInput = rangecast::kMaxAccessUnitSize + rangecast::kAccessUnitHeaderSize;

std::vector<std::uint8_t> input_bytes;

} // namespace

RangecastDecoder &
web::decoder ()
{
  static RangecastDecoder *made = nullptr;
  if (!made)
    made = new RangecastDecoder (1);
  return *made;
}

std::span<const std::uint8_t>
web::input (std::uint32_t size)
{
  const std::span<const std::uint8_t> bytes (input_bytes);
  return size <= bytes.size () ? bytes.first (size) : bytes.first (0);
}

/** The instance's decoder. */
RC_EXPORT (rc_decoder) RangecastDecoder *rc_decoder ()
{
  return &web::decoder ();
}

/** Memory for `size` bytes of input, until the next call; nullptr if that is more than any message
 *  has. */
RC_EXPORT (rc_input) std::uint8_t *rc_input (std::uint32_t size)
{
  if (size > kMaxInput)
    return nullptr;
  if (input_bytes.size () < size)
    input_bytes.resize (size);
  return input_bytes.data ();
}

/** Memory for any struct of rangecast.h. */
RC_EXPORT (rc_struct) void *rc_struct ()
{
  alignas (8) static std::uint8_t memory[256];
  return memory;
}

/** rangecast_decoder_open() of what rc_read() reads. */
RC_EXPORT (rc_open) std::int32_t rc_open (double size)
{
  const auto read = [] (void *, std::uint64_t offset, void *to, std::size_t n) -> std::size_t {
    return rc_read (double (offset), static_cast<std::uint32_t> (n), to);
  };
  return web::decoder ().open (size > 0 ? static_cast<std::uint64_t> (size) : 0, read, nullptr);
}

/** The frame set as a PLY file. @return a record: address, bytes; nullptr, with a message, if there
 *  is no frame set */
RC_EXPORT (rc_ply) const double *rc_ply ()
{
  static std::vector<std::uint8_t> file;
  static double record[2];
  RangecastDecoder &decoder = web::decoder ();
  const rangecast::PointCloudWriter writer ({});
  const std::size_t points = decoder.images ().empty () ? 0 : decoder.frame_set ().n_points;
  if (points == 0) {
    decoder.fail ("There is nothing to save.");
    return nullptr;
  }
  file.resize (writer.size (points));
  if (const auto status = writer.write (decoder.images (), *decoder.rig (), file); !status.ok ()) {
    decoder.fail (status.message ());
    return nullptr;
  }
  record[0] = double (reinterpret_cast<std::uintptr_t> (file.data ()));
  record[1] = double (file.size ());
  return record;
}
