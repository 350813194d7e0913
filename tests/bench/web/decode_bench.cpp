/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Times librangecast's decoder with one thread, which decode.mjs runs beside rangecast.wasm.
 * usage: decode_bench FILE.rcnc...: for each file prints the milliseconds of one frame set, mean of
 * one pass after another that was not timed. */
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <rangecast.h>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <vector>

namespace {

using Bytes = std::vector<std::uint8_t>;

/* @return the units of each access unit */
std::vector<std::span<const std::uint8_t>>
access_units (std::span<const std::uint8_t> bytes)
{
  std::vector<std::span<const std::uint8_t>> units;
  for (auto part = rangecast::next_part (bytes, true); part.length || part.garbage;
       part = rangecast::next_part (bytes, true)) {
    if (part.length)
      units.push_back (bytes.subspan (
          rangecast::kAccessUnitHeaderSize, part.length - rangecast::kAccessUnitHeaderSize));
    bytes = bytes.subspan (part.length + part.garbage);
  }
  return units;
}

/* @return frame sets that were decoded */
int
decode_all (RangecastDecoder *decoder, const std::vector<std::span<const std::uint8_t>> &frame_sets)
{
  int done = 0;
  rangecast_decoder_reset (decoder);
  for (const auto &units : frame_sets) {
    rangecast_decoder_push_units (decoder, units.data (), units.size ());
    done += rangecast_decoder_next (decoder) == RANGECAST_OK;
  }
  return done;
}

bool
measure (const char *path)
{
  std::ifstream file (path, std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char> (file), {}};
  const auto frame_sets = access_units (bytes);
  RangecastDecoder *const decoder = rangecast_decoder_new (1);
  decode_all (decoder, frame_sets);
  const auto begin = std::chrono::steady_clock::now ();
  const int done = decode_all (decoder, frame_sets);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now () - begin;
  rangecast_decoder_free (decoder);
  if (done == 0)
    std::fprintf (stderr, "decode_bench: %s: expected a recording (.rcnc)\n", path);
  else
    std::printf ("%.4f\n", took.count () / done);
  return done > 0;
}

} // namespace

int
main (int argc, char **argv)
{
  if (argc < 2) {
    std::fprintf (stderr, "usage: decode_bench FILE.rcnc...\n");
    return 2;
  }
  for (int i = 1; i < argc; i++)
    if (!measure (argv[i]))
      return 1;
}
