/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as each input of rangecast.h, and triangles of what comes out. */
#include <rangecast.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

struct File {
  const std::uint8_t *data;
  std::size_t size;
};

static std::size_t
read_file (void *user_data, std::uint64_t offset, void *to, std::size_t size)
{
  const auto file = static_cast<const File *> (user_data);
  const std::size_t n = offset < file->size ? std::min (size, file->size - offset) : 0;
  std::memcpy (to, file->data + offset, n);
  return n;
}

static void
play (RangecastDecoder *decoder)
{
  RangecastFrameSet frame_set{};
  frame_set.struct_size = sizeof frame_set;
  const RangecastLayout layout = {sizeof layout, 40, 0, 12, 24, 28, 0, 1};
  for (int i = 0; i < 20 && rangecast_decoder_next (decoder) == RANGECAST_OK; i++) {
    rangecast_decoder_get_frame_set (decoder, &frame_set);
    if (frame_set.n_points > 1 << 20)
      continue;
    std::vector<std::uint8_t> vertices (40 * frame_set.n_points);
    std::vector<std::uint32_t> indices (6 * frame_set.n_points);
    std::size_t n = 0;
    if (frame_set.n_points > 0 &&
        rangecast_decoder_get_triangles (decoder, &layout, vertices.data (), frame_set.n_points, &n,
            indices.data (), indices.size (), nullptr) != RANGECAST_OK)
      std::abort ();
    if (n != frame_set.n_points)
      std::abort ();
  }
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  RangecastDecoder *decoder = rangecast_decoder_new (1);
  File file = {data, size};
  for (const std::size_t piece : {size / 3 + 1, size + 1}) {
    for (std::size_t at = 0; at < size; at += piece) {
      rangecast_decoder_push_bytes (decoder, data + at, std::min (piece, size - at));
      play (decoder);
    }
    rangecast_decoder_push_bytes (decoder, nullptr, 0);
    play (decoder);
    rangecast_decoder_reset (decoder);
  }
  rangecast_decoder_open (decoder, size, read_file, &file);
  play (decoder);
  rangecast_decoder_seek (decoder, 1'000'000'000);
  play (decoder);
  rangecast_decoder_push_units (decoder, data, size);
  play (decoder);
  rangecast_decoder_free (decoder);
  return 0;
}
