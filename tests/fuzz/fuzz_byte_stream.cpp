/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as a byte stream: read to its end in growing pieces; and as a file, by time. */
#include <algorithm>
#include <cstdlib>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

using namespace rangecast;

static void
read_stream (std::span<const std::uint8_t> bytes)
{
  std::size_t size = 0; /* of what has come so far */
  while (!bytes.empty ()) {
    const bool at_end = size >= bytes.size ();
    const StreamPart part = next_part (bytes.first (std::min (size, bytes.size ())), at_end);
    const std::size_t used = part.length + part.garbage;
    if (used > bytes.size () || (part.wanted ? part.wanted <= size || at_end : used == 0))
      std::abort ();
    bytes = bytes.subspan (used);
    size = part.wanted ? part.wanted : size - std::min (size, used);
  }
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  const std::span<const std::uint8_t> bytes (data, size);
  read_stream (bytes);
  StreamFile file (
      [bytes] (std::uint64_t offset, std::size_t count, std::vector<std::uint8_t> &to) {
        const auto begin = std::min<std::size_t> (offset, bytes.size ());
        const auto part = bytes.subspan (begin, std::min (count, bytes.size () - begin));
        to.assign (part.begin (), part.end ());
      },
      size);
  const auto last = file.last ();
  (void)file.locate (last ? last->header.pts_ns : 5'000'000'000);
  return 0;
}
