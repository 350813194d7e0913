/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as each input of rangecast.h, and triangles of what comes out. */
#include <rangecast.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
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

/* @return a sum of all that can be read */
static std::uint64_t
read_all (RangecastDecoder *decoder)
{
  RangecastStream stream{};
  RangecastCamera camera{};
  RangecastView view{};
  stream.struct_size = sizeof stream;
  camera.struct_size = sizeof camera;
  view.struct_size = sizeof view;
  rangecast_decoder_get_stream (decoder, &stream);
  std::uint64_t sum = *rangecast_decoder_get_message (decoder);
  for (std::uint32_t i = 0; rangecast_decoder_get_camera (decoder, i, &camera) == RANGECAST_OK; i++)
    sum += std::uint64_t (camera.width);
  for (std::uint32_t i = 0; rangecast_decoder_get_view (decoder, i, &view) == RANGECAST_OK; i++)
    for (std::int64_t p = 0; p < std::int64_t{view.width} * view.height; p++)
      sum += view.depth[p] + view.colour[4 * p];
  return sum;
}

static void
play (RangecastDecoder *decoder)
{
  RangecastFrameSet frame_set{};
  frame_set.struct_size = sizeof frame_set;
  const RangecastLayout layout = {sizeof layout, 40, 0, 12, 24, 28, 0, 1};
  RangecastResult result = RANGECAST_OK;
  for (int i = 0; i < 20 && result == RANGECAST_OK; i++) {
    result = rangecast_decoder_next (decoder);
    if (read_all (decoder) == 1)
      std::puts ("1");
    rangecast_decoder_get_frame_set (decoder, &frame_set);
    if (frame_set.n_points > 1 << 20)
      continue;
    std::vector<std::uint8_t> vertices (40 * frame_set.n_points + 1);
    std::vector<std::uint32_t> indices (6 * frame_set.n_points + 1);
    std::size_t n = 0;
    if (rangecast_decoder_get_triangles (decoder, &layout, vertices.data (), frame_set.n_points, &n,
            indices.data (), indices.size (), nullptr) == RANGECAST_ERROR ||
        n != frame_set.n_points)
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
  rangecast_decoder_seek (decoder, 0);
  play (decoder);
  rangecast_decoder_free (decoder);
  return 0;
}
