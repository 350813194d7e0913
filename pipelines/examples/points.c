/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Writes the person of a recording's first frame set as a PLY file of coloured triangles, without
 * GStreamer.
 *
 *     cc points.c -o points $(pkg-config --cflags --libs rangecast-1.0)
 *     ./points head.rcnc head.ply
 */
#include <rangecast.h>
#include <stdio.h>
#include <stdlib.h>

struct vertex {
  float position[3];
  uint8_t colour[4];
};

static size_t
read_file (void *file, uint64_t offset, void *to, size_t size)
{
  return fseek (file, (long)offset, SEEK_SET) == 0 ? fread (to, 1, size, file) : 0;
}

static int
write_ply (const char *path, const struct vertex *vertices, size_t n_vertices,
    const uint32_t *indices, size_t n_indices)
{
  FILE *ply = fopen (path, "w");
  if (!ply)
    return 1;
  fprintf (ply,
      "ply\nformat ascii 1.0\nelement vertex %zu\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face %zu\nproperty list uchar uint vertex_indices\nend_header\n",
      n_vertices, n_indices / 3);
  for (const struct vertex *v = vertices; v < vertices + n_vertices; v++)
    fprintf (ply, "%g %g %g %d %d %d\n", v->position[0], v->position[1], v->position[2],
        v->colour[0], v->colour[1], v->colour[2]);
  for (size_t i = 0; i < n_indices; i += 3)
    fprintf (ply, "3 %u %u %u\n", indices[i], indices[i + 1], indices[i + 2]);
  return fclose (ply);
}

int
main (int argc, char **argv)
{
  FILE *file = argc == 3 ? fopen (argv[1], "rb") : NULL;
  int status = 1;
  if (!file || fseek (file, 0, SEEK_END) != 0) {
    fputs (argc == 3 ? "cannot read the recording\n" : "usage: points RECORDING PLY\n", stderr);
    return 2;
  }
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  rangecast_decoder_open (decoder, (uint64_t)ftell (file), read_file, file);
  if (rangecast_decoder_next (decoder) != RANGECAST_OK) {
    fprintf (stderr, "%s: %s\n", argv[1], rangecast_decoder_get_message (decoder));
    return 1;
  }
  RangecastFrameSet frame_set = {.struct_size = sizeof frame_set};
  rangecast_decoder_get_frame_set (decoder, &frame_set);
  const RangecastLayout layout = {.struct_size = sizeof layout,
      .stride = sizeof (struct vertex),
      .position = offsetof (struct vertex, position),
      .normal = -1,
      .colour = offsetof (struct vertex, colour),
      .confidence = -1};
  size_t n_vertices, n_indices;
  struct vertex *vertices = calloc (frame_set.n_points, sizeof *vertices);
  uint32_t *indices = calloc (frame_set.n_points, 6 * sizeof *indices);
  if (rangecast_decoder_get_triangles (decoder, &layout, vertices, frame_set.n_points, &n_vertices,
          indices, 6 * frame_set.n_points, &n_indices) == RANGECAST_ERROR)
    fprintf (stderr, "%s: %s\n", argv[1], rangecast_decoder_get_message (decoder));
  else if ((status = write_ply (argv[2], vertices, n_vertices, indices, n_indices)) != 0)
    perror (argv[2]);
  free (vertices);
  free (indices);
  rangecast_decoder_free (decoder);
  fclose (file);
  return status;
}
