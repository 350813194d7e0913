/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangecast.h from C. usage: decoder FOLDER_WITH_RECORDINGS */
#include <math.h>
#include <rangecast.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(fact)                                                                                \
  do {                                                                                             \
    if (!(fact)) {                                                                                 \
      fprintf (stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #fact);                        \
      exit (1);                                                                                    \
    }                                                                                              \
  } while (0)

struct bytes {
  uint8_t *data;
  size_t size;
};
struct vertex {
  float position[3], normal[3];
  uint8_t colour[4];
  float confidence;
};

static struct bytes
read_recording (const char *folder, const char *name)
{
  char path[4096];
  struct bytes all;
  snprintf (path, sizeof path, "%s/%s.rcnc", folder, name);
  FILE *file = fopen (path, "rb");
  CHECK (file && fseek (file, 0, SEEK_END) == 0);
  all.size = (size_t)ftell (file);
  all.data = malloc (all.size);
  rewind (file);
  CHECK (fread (all.data, 1, all.size, file) == all.size);
  fclose (file);
  return all;
}

static size_t
read_bytes (void *user_data, uint64_t offset, void *to, size_t size)
{
  const struct bytes *all = user_data;
  if (offset >= all->size)
    return 0;
  if (size > all->size - offset)
    size = all->size - offset;
  memcpy (to, all->data + offset, size);
  return size;
}

/* FNV-1a of the planes. */
static uint64_t
digest (RangecastDecoder *decoder)
{
  uint64_t hash = 14695981039346656037u;
  RangecastView view = {.struct_size = sizeof view};
  for (uint32_t i = 0; rangecast_decoder_get_view (decoder, i, &view) == RANGECAST_OK; i++) {
    const size_t pixels = (size_t)view.width * (size_t)view.height;
    for (size_t p = 0; p < pixels; p++) {
      hash = (hash ^ view.depth[p]) * 1099511628211u;
      for (int c = 0; c < 3 && view.depth[p]; c++)
        hash = (hash ^ view.colour[4 * p + (size_t)c]) * 1099511628211u;
    }
  }
  return hash;
}

static size_t
play (RangecastDecoder *decoder, uint64_t *digests, size_t max)
{
  size_t n = 0;
  while (n < max && rangecast_decoder_next (decoder) == RANGECAST_OK)
    digests[n++] = digest (decoder);
  return n;
}

static void
test_pieces_of_any_size_decode_as_the_file_does (struct bytes all)
{
  uint64_t expected[100], got[100];
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  CHECK (rangecast_decoder_open (decoder, all.size, read_bytes, &all) == RANGECAST_OK);
  const size_t n = play (decoder, expected, 100);
  CHECK (n > 1 && rangecast_decoder_next (decoder) == RANGECAST_END);
  for (size_t piece = 7; piece <= all.size; piece = piece * 11 + 1) {
    size_t m = 0;
    rangecast_decoder_reset (decoder);
    for (size_t at = 0; at < all.size; at += piece) {
      const size_t size = all.size - at < piece ? all.size - at : piece;
      CHECK (rangecast_decoder_push_bytes (decoder, all.data + at, size) == RANGECAST_OK);
      m += play (decoder, got + m, 100 - m);
    }
    CHECK (rangecast_decoder_next (decoder) == RANGECAST_NOTHING);
    rangecast_decoder_push_bytes (decoder, NULL, 0);
    m += play (decoder, got + m, 100 - m);
    CHECK (rangecast_decoder_next (decoder) == RANGECAST_END);
    CHECK (m == n && memcmp (expected, got, n * sizeof *got) == 0);
  }
  rangecast_decoder_free (decoder);
}

static void
test_seeking_comes_to_frame_sets_of_playing (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (1);
  RangecastStream stream = {.struct_size = sizeof stream};
  RangecastFrameSet frame = {.struct_size = sizeof frame};
  CHECK (rangecast_decoder_open (decoder, all.size, read_bytes, &all) == RANGECAST_OK);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  const uint64_t first = digest (decoder);
  CHECK (rangecast_decoder_get_stream (decoder, &stream) == RANGECAST_OK);
  CHECK (stream.n_cameras >= 1 && stream.duration > 0 && stream.duration != RANGECAST_NO_TIME);
  while (rangecast_decoder_next (decoder) == RANGECAST_OK)
    rangecast_decoder_get_frame_set (decoder, &frame);
  CHECK (frame.time == stream.duration && frame.n_views == stream.n_cameras && frame.n_points > 0);
  CHECK (rangecast_decoder_seek (decoder, 0) == RANGECAST_OK);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  CHECK (digest (decoder) == first);
  rangecast_decoder_free (decoder);
}

static void
test_triangles_are_small_and_of_valid_pixels (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  RangecastFrameSet frame = {.struct_size = sizeof frame};
  const RangecastLayout layout = {sizeof layout, sizeof (struct vertex), 0, 12, 24, 28, 0, 0};
  size_t n_vertices = 0, n_indices = 0;
  rangecast_decoder_push_bytes (decoder, all.data, all.size);
  CHECK (rangecast_decoder_get_triangles (decoder, &layout, NULL, 0, NULL, NULL, 0, NULL) ==
         RANGECAST_NOTHING);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  rangecast_decoder_get_frame_set (decoder, &frame);
  const size_t max = frame.n_points;
  struct vertex *v = malloc (max * sizeof *v);
  uint32_t *indices = malloc (6 * max * sizeof *indices);
  CHECK (rangecast_decoder_get_triangles (
             decoder, &layout, v, max, &n_vertices, indices, 6 * max, &n_indices) == RANGECAST_OK);
  CHECK (n_vertices == frame.n_points);
  CHECK (n_indices % 3 == 0 && n_indices > 3 * n_vertices);
  for (size_t i = 0; i < n_vertices; i++) {
    const float *n = v[i].normal;
    CHECK (fabsf (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-3f);
    CHECK (v[i].confidence >= 0 && v[i].confidence <= 1 && v[i].colour[3] == 255);
    CHECK (isfinite (v[i].position[0] + v[i].position[1] + v[i].position[2]));
  }
  size_t outward = 0;
  for (size_t i = 0; i < n_indices; i += 3) {
    CHECK (indices[i] < n_vertices && indices[i + 1] < n_vertices && indices[i + 2] < n_vertices);
    const float *a = v[indices[i]].position, *b = v[indices[i + 1]].position;
    const float *c = v[indices[i + 2]].position, *n = v[indices[i]].normal;
    float e[3], f[3];
    for (int k = 0; k < 3; k++) {
      e[k] = b[k] - a[k];
      f[k] = c[k] - a[k];
      CHECK (fabsf (e[k]) < 0.1f && fabsf (f[k]) < 0.1f);
    }
    outward += n[0] * (e[1] * f[2] - e[2] * f[1]) + n[1] * (e[2] * f[0] - e[0] * f[2]) +
                   n[2] * (e[0] * f[1] - e[1] * f[0]) >
               0;
  }
  CHECK (outward > n_indices / 3 * 99 / 100);
  /* Unreal's axes, centimetres. */
  const RangecastLayout other = {
      sizeof other, 12, 0, -1, -1, -1, RANGECAST_LEFT_HANDED | RANGECAST_Z_UP, 100};
  float *p = malloc (max * 12);
  CHECK (rangecast_decoder_get_triangles (decoder, &other, p, max, NULL, NULL, 0, &n_indices) ==
         RANGECAST_OK);
  CHECK (n_indices == 0);
  for (size_t i = 0; i < n_vertices; i++)
    for (int k = 0; k < 3; k++)
      CHECK (fabsf (p[3 * i + (size_t)k] - 100 * v[i].position[k == 0 ? 0 : 3 - k]) < 1e-3f);
  /* The other way round. */
  RangecastLayout reversed = layout;
  reversed.flags = RANGECAST_CLOCKWISE;
  uint32_t *others = malloc (6 * max * sizeof *others);
  rangecast_decoder_get_triangles (decoder, &reversed, NULL, 0, NULL, others, 6 * max, &n_indices);
  for (size_t i = 0; i < n_indices; i += 3)
    CHECK (others[i] == indices[i] && others[i + 1] == indices[i + 2] &&
           others[i + 2] == indices[i + 1]);
  free (others);
  /* One too few. */
  CHECK (rangecast_decoder_get_triangles (
             decoder, &layout, v, max - 1, &n_vertices, NULL, 0, NULL) == RANGECAST_ERROR);
  CHECK (strstr (rangecast_decoder_get_message (decoder), "too small"));
  CHECK (n_vertices == max);
  free (p);
  free (indices);
  free (v);
  rangecast_decoder_free (decoder);
}

static void
test_cameras_project_points_to_their_pixels (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  const RangecastLayout layout = {sizeof layout, 12, 0, -1, -1, -1, 0, 0};
  RangecastCamera camera = {.struct_size = sizeof camera};
  RangecastView view = {.struct_size = sizeof view};
  rangecast_decoder_push_bytes (decoder, all.data, all.size);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  CHECK (rangecast_decoder_get_camera (decoder, 0, &camera) == RANGECAST_OK);
  CHECK (rangecast_decoder_get_camera (decoder, 64, &camera) == RANGECAST_NOTHING);
  CHECK (rangecast_decoder_get_view (decoder, 0, &view) == RANGECAST_OK);
  CHECK (camera.view_id == view.view_id);
  const size_t pixels = (size_t)view.width * (size_t)view.height;
  float *points = malloc (4 * pixels * 12), *p = points;
  rangecast_decoder_get_triangles (decoder, &layout, points, 4 * pixels, NULL, NULL, 0, NULL);
  const double *m = camera.world_from_view;
  for (size_t i = 0; i < pixels; i++) {
    if (!view.depth[i])
      continue;
    double local[3];
    for (int k = 0; k < 3; k++)
      local[k] = m[k] * (p[0] - m[3]) + m[4 + k] * (p[1] - m[7]) + m[8 + k] * (p[2] - m[11]);
    const double u = camera.fx * local[0] / local[2] + camera.cx - view.x;
    const double w = camera.fy * local[1] / local[2] + camera.cy - view.y;
    CHECK (fabs (u - (double)(i % (size_t)view.width)) < 0.01);
    CHECK (fabs (w - (double)(i / (size_t)view.width)) < 0.01);
    CHECK (fabs (local[2] - view.depth[i] * camera.depth_unit) < 1e-4);
    p += 3;
  }
  free (points);
  rangecast_decoder_free (decoder);
}

static void
test_bad_arguments_are_errors (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  RangecastFrameSet frame = {.struct_size = 0};
  RangecastLayout layout = {sizeof layout, 8, 0, -1, -1, -1, 0, 0};
  float vertex[3];
  CHECK (rangecast_decoder_next (NULL) == RANGECAST_ERROR);
  CHECK (strstr (rangecast_decoder_get_message (NULL), "NULL"));
  CHECK (rangecast_decoder_push_units (NULL, all.data, all.size) == RANGECAST_ERROR);
  CHECK (rangecast_decoder_push_units (decoder, NULL, 100) == RANGECAST_OK);
  CHECK (rangecast_decoder_open (decoder, 100, NULL, NULL) == RANGECAST_ERROR);
  CHECK (rangecast_decoder_get_frame_set (decoder, &frame) == RANGECAST_ERROR);
  CHECK (rangecast_decoder_get_view (decoder, 0, NULL) == RANGECAST_NOTHING);
  CHECK (rangecast_decoder_seek (decoder, 5) == RANGECAST_NOTHING);
  rangecast_decoder_reset (decoder);
  rangecast_decoder_push_bytes (decoder, all.data, all.size);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  CHECK (rangecast_decoder_get_view (decoder, 0, NULL) == RANGECAST_ERROR);
  CHECK (rangecast_decoder_get_triangles (decoder, NULL, vertex, 1, NULL, NULL, 0, NULL) ==
         RANGECAST_ERROR);
  CHECK (rangecast_decoder_get_triangles (decoder, &layout, vertex, 1, NULL, NULL, 0, NULL) ==
         RANGECAST_ERROR);
  CHECK (strstr (rangecast_decoder_get_message (decoder), "stride"));
  rangecast_decoder_free (decoder);
  rangecast_decoder_free (NULL);
}

static void
test_older_callers_get_the_fields_that_they_know (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (0);
  struct {
    RangecastFrameSet frame;
    uint8_t beyond[8];
  } old;
  memset (&old, 0xee, sizeof old);
  old.frame.struct_size = offsetof (RangecastFrameSet, time);
  rangecast_decoder_push_bytes (decoder, all.data, all.size);
  CHECK (rangecast_decoder_next (decoder) == RANGECAST_OK);
  CHECK (rangecast_decoder_get_frame_set (decoder, &old.frame) == RANGECAST_OK);
  CHECK (old.frame.n_views > 0 && old.frame.time == 0xeeeeeeeeeeeeeeeeu);
  old.frame.struct_size = sizeof old; /* of a newer header */
  CHECK (rangecast_decoder_get_frame_set (decoder, &old.frame) == RANGECAST_OK);
  CHECK (old.frame.n_points > 0 && old.beyond[0] == 0xee);
  rangecast_decoder_free (decoder);
}

static void
test_every_end_has_a_sentence (struct bytes all)
{
  RangecastDecoder *decoder = rangecast_decoder_new (1);
  for (size_t size = 0; size < all.size; size += size < 200 ? 1 : 97) {
    struct bytes part = {malloc (size ? size : 1), size}; /* so that a byte too far is noticed */
    RangecastResult result;
    memcpy (part.data, all.data, size);
    rangecast_decoder_open (decoder, size, read_bytes, &part);
    while ((result = rangecast_decoder_next (decoder)) == RANGECAST_OK)
      ;
    CHECK (result == RANGECAST_END || result == RANGECAST_FATAL);
    CHECK (result == RANGECAST_END || *rangecast_decoder_get_message (decoder));
    free (part.data);
  }
  rangecast_decoder_free (decoder);
}

int
main (int argc, char **argv)
{
  static const char *const names[] = {"default", "temporal-packed", "temporal-entropy"};
  CHECK (argc == 2);
  for (size_t i = 0; i < 3; i++) {
    const struct bytes all = read_recording (argv[1], names[i]);
    test_pieces_of_any_size_decode_as_the_file_does (all);
    test_seeking_comes_to_frame_sets_of_playing (all);
    test_triangles_are_small_and_of_valid_pixels (all);
    test_cameras_project_points_to_their_pixels (all);
    test_bad_arguments_are_errors (all);
    test_older_callers_get_the_fields_that_they_know (all);
    test_every_end_has_a_sentence (all);
    free (all.data);
  }
  return 0;
}
