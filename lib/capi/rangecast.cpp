/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The functions of rangecast.h. Exceptions end here: only memory can run out. */
#include "rangecast.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <new>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/geometry/world_points.hpp>

#include "decoder.hpp"

using rangecast::BlendPlanes;
using rangecast::RangeImage;
using rangecast::Vec3;
using rangecast::View;

namespace {

template <typename Call>
RangecastResult
guarded (RangecastDecoder *decoder, const Call &call)
{
  if (!decoder)
    return RANGECAST_ERROR;
  try {
    return call ();
  } catch (...) {
    decoder->drop_frame_set ();
    try {
      return decoder->fail ("Out of memory.");
    } catch (...) {
      return RANGECAST_ERROR;
    }
  }
}

/* As much of a struct as the caller knows. */
template <typename Struct>
RangecastResult
give (const Struct &from, Struct *to)
{
  if (!to || to->struct_size < sizeof (std::uint32_t))
    return RANGECAST_ERROR;
  const std::uint32_t size = to->struct_size;
  std::memcpy (to, &from, std::min<std::size_t> (size, sizeof from));
  to->struct_size = size;
  return RANGECAST_OK;
}

/* Writes vertices and indices of one view after another, and counts those beyond the limits. */
class MeshWriter {
public:
  MeshWriter (const RangecastLayout &layout, void *vertices, std::size_t max_vertices,
      std::uint32_t *indices, std::size_t max_indices)
      : layout_ (layout), vertices_ (static_cast<std::uint8_t *> (vertices)),
        max_vertices_ (max_vertices), indices_ (indices), max_indices_ (max_indices)
  {
  }

  void add (const RangeImage &image, const View &view, const BlendPlanes &planes);
  [[nodiscard]] std::size_t n_vertices () const { return n_vertices_; }
  [[nodiscard]] std::size_t n_indices () const { return n_indices_; }

private:
  void add_vertex (
      const RangeImage &image, const View &view, const BlendPlanes &planes, int x, int y);
  void add_triangle (std::uint32_t a, std::uint32_t b, std::uint32_t c);
  void write_vector (std::int32_t offset, Vec3 v, float scale, std::uint8_t *to) const;

  const RangecastLayout &layout_;
  std::uint8_t *vertices_;
  std::size_t max_vertices_;
  std::uint32_t *indices_;
  std::size_t max_indices_;
  std::size_t n_vertices_ = 0, n_indices_ = 0;
  rangecast::PixelRays rays_;
  std::vector<std::uint32_t> above_, row_; /* numbers of the vertices of two rows */
};

void
MeshWriter::write_vector (std::int32_t offset, Vec3 v, float scale, std::uint8_t *to) const
{
  if (offset < 0)
    return;
  if (layout_.flags & RANGECAST_LEFT_HANDED)
    v.z = -v.z;
  if (layout_.flags & RANGECAST_Z_UP)
    v = {v.x, -v.z, v.y};
  const float out[] = {float (v.x) * scale, float (v.y) * scale, float (v.z) * scale};
  std::memcpy (to + offset, out, sizeof out);
}

void
MeshWriter::add_vertex (
    const RangeImage &image, const View &view, const BlendPlanes &planes, int x, int y)
{
  const std::size_t number = n_vertices_++;
  if (!vertices_ || number >= max_vertices_)
    return;
  std::uint8_t *to = vertices_ + number * layout_.stride;
  float point[3];
  rays_.point (float (image.roi.x + x), float (image.roi.y + y), image.depth.row (y)[x], point);
  write_vector (
      layout_.position, {point[0], point[1], point[2]}, layout_.scale > 0 ? layout_.scale : 1, to);
  if (layout_.normal >= 0)
    write_vector (layout_.normal,
        view.world_from_view.rotation * rangecast::surface_normal (image, view.intrinsics, x, y), 1,
        to);
  if (layout_.colour >= 0) {
    const rangecast::Rgbx &c = image.colour.row (y)[x];
    const std::uint8_t colour[] = {c.r, c.g, c.b, 255};
    std::memcpy (to + layout_.colour, colour, sizeof colour);
  }
  if (layout_.confidence >= 0) {
    const float root =
        float (planes.weight[std::size_t (y) * std::size_t (planes.width) + std::size_t (x)]) / 255;
    const float weight = root * root;
    std::memcpy (to + layout_.confidence, &weight, sizeof weight);
  }
}

void
MeshWriter::add_triangle (std::uint32_t a, std::uint32_t b, std::uint32_t c)
{
  if (indices_ && n_indices_ + 3 <= max_indices_) {
    indices_[n_indices_] = a;
    indices_[n_indices_ + 1] = layout_.flags & RANGECAST_CLOCKWISE ? c : b;
    indices_[n_indices_ + 2] = layout_.flags & RANGECAST_CLOCKWISE ? b : c;
  }
  n_indices_ += 3;
}

void
MeshWriter::add (const RangeImage &image, const View &view, const BlendPlanes &planes)
{
  const int width = image.roi.width;
  rays_ = rangecast::PixelRays (view);
  row_.resize (std::size_t (width));
  above_.resize (std::size_t (width));
  for (int y = 0; y < image.roi.height; y++) {
    std::swap (above_, row_);
    for (int x = 0; x < width; x++) {
      row_[std::size_t (x)] = std::uint32_t (n_vertices_);
      if (image.depth.row (y)[x] != rangecast::kInvalidDepth)
        add_vertex (image, view, planes, x, y);
    }
    if (y == 0 || !indices_)
      continue;
    const rangecast::Rgbx *flags = planes.colour_plane ().row (y - 1),
                          *below = planes.colour_plane ().row (y);
    for (std::size_t x = 0; x + 1 < std::size_t (width); x++) {
      /* The edges of the square of four pixels along which there is one surface. */
      const bool top = flags[x].x & rangecast::kJoinsRight,
                 bottom = below[x].x & rangecast::kJoinsRight;
      const bool left = flags[x].x & rangecast::kJoinsBelow,
                 right = flags[x + 1].x & rangecast::kJoinsBelow;
      const std::uint32_t a = above_[x], b = above_[x + 1], c = row_[x], d = row_[x + 1];
      if (top && left)
        add_triangle (a, c, b);
      if (bottom && right)
        add_triangle (b, c, d);
      else if (bottom && left && !top)
        add_triangle (a, c, d);
      else if (top && right && !left)
        add_triangle (a, d, b);
    }
  }
}

/* Fields that are added later must count as absent in a struct of the first version's size. */
bool
is_valid (const RangecastLayout *layout)
{
  constexpr std::uint32_t kFirstSize = 32;
  if (!layout || layout->struct_size < kFirstSize)
    return false;
  const auto fits = [layout] (std::int32_t offset, std::int32_t size) {
    return offset < 0 || (size <= std::int64_t{layout->stride} - offset);
  };
  return fits (layout->position, 12) && fits (layout->normal, 12) && fits (layout->colour, 4) &&
         fits (layout->confidence, 4);
}

} // namespace

RangecastDecoder *
rangecast_decoder_new (uint32_t n_threads)
{
  return new (std::nothrow) RangecastDecoder (int (std::min (n_threads, 1024u)));
}

void
rangecast_decoder_free (RangecastDecoder *decoder)
{
  delete decoder;
}

const char *
rangecast_decoder_get_message (const RangecastDecoder *decoder)
{
  return decoder ? decoder->message ().c_str () : "There is no decoder (NULL).";
}

RangecastResult
rangecast_decoder_push_units (RangecastDecoder *decoder, const void *bytes, size_t size)
{
  return guarded (decoder, [&] {
    decoder->push_units ({static_cast<const std::uint8_t *> (bytes), bytes ? size : 0});
    return RANGECAST_OK;
  });
}

RangecastResult
rangecast_decoder_push_bytes (RangecastDecoder *decoder, const void *bytes, size_t size)
{
  return guarded (decoder, [&] {
    return decoder->push_bytes ({static_cast<const std::uint8_t *> (bytes), bytes ? size : 0});
  });
}

RangecastResult
rangecast_decoder_open (
    RangecastDecoder *decoder, uint64_t size, RangecastRead read, void *user_data)
{
  return guarded (decoder, [&] { return decoder->open (size, read, user_data); });
}

void
rangecast_decoder_discontinuity (RangecastDecoder *decoder)
{
  if (decoder)
    decoder->discontinuity ();
}

void
rangecast_decoder_reset (RangecastDecoder *decoder)
{
  guarded (decoder, [&] {
    decoder->reset ();
    return RANGECAST_OK;
  });
}

RangecastResult
rangecast_decoder_next (RangecastDecoder *decoder)
{
  return guarded (decoder, [&] { return decoder->next (); });
}

RangecastResult
rangecast_decoder_seek (RangecastDecoder *decoder, uint64_t time)
{
  return guarded (decoder, [&] { return decoder->seek (time); });
}

RangecastResult
rangecast_decoder_get_stream (const RangecastDecoder *decoder, RangecastStream *stream)
{
  return decoder ? give (decoder->stream (), stream) : RANGECAST_ERROR;
}

RangecastResult
rangecast_decoder_get_camera (
    const RangecastDecoder *decoder, uint32_t index, RangecastCamera *camera)
{
  const rangecast::Rig *rig = decoder ? decoder->rig () : nullptr;
  if (!rig || index >= rig->views.size ())
    return decoder ? RANGECAST_NOTHING : RANGECAST_ERROR;
  const View &v = rig->views[index];
  const auto &r = v.world_from_view.rotation;
  const Vec3 &t = v.world_from_view.translation;
  return give (
      {0, v.id, v.width, v.height, v.intrinsics.fx, v.intrinsics.fy, v.intrinsics.cx,
          v.intrinsics.cy, {r[0], r[1], r[2], t.x, r[3], r[4], r[5], t.y, r[6], r[7], r[8], t.z},
          v.depth_unit_m, v.near_m, v.far_m},
      camera);
}

RangecastResult
rangecast_decoder_get_frame_set (const RangecastDecoder *decoder, RangecastFrameSet *frame_set)
{
  return decoder ? give (decoder->frame_set (), frame_set) : RANGECAST_ERROR;
}

RangecastResult
rangecast_decoder_get_view (const RangecastDecoder *decoder, uint32_t index, RangecastView *view)
{
  if (!decoder || index >= decoder->images ().size ())
    return decoder ? RANGECAST_NOTHING : RANGECAST_ERROR;
  const RangeImage &image = decoder->images ()[index];
  return give ({0, image.view_id, image.roi.x, image.roi.y, image.roi.width, image.roi.height,
                   image.depth.data, reinterpret_cast<const std::uint8_t *> (image.colour.data)},
      view);
}

RangecastResult
rangecast_decoder_get_triangles (RangecastDecoder *decoder, const RangecastLayout *layout,
    void *vertices, size_t max_vertices, size_t *n_vertices, uint32_t *indices, size_t max_indices,
    size_t *n_indices)
{
  if (n_vertices)
    *n_vertices = 0;
  if (n_indices)
    *n_indices = 0;
  return guarded (decoder, [&] {
    if (decoder->images ().empty ())
      return RANGECAST_NOTHING;
    if (!is_valid (layout))
      return decoder->fail ("The layout needs its struct_size, and a stride that holds all "
                            "attributes.");
    MeshWriter writer (*layout, vertices, max_vertices, indices, max_indices);
    const auto planes = decoder->planes ();
    for (std::size_t i = 0; i < planes.size (); i++) {
      const RangeImage &image = decoder->images ()[i];
      writer.add (image, *decoder->rig ()->find (image.view_id), planes[i]);
    }
    if (n_vertices)
      *n_vertices = writer.n_vertices ();
    if (n_indices)
      *n_indices = writer.n_indices ();
    if ((vertices && writer.n_vertices () > max_vertices) ||
        (indices && writer.n_indices () > max_indices))
      return decoder->fail ("The arrays are too small: " + std::to_string (writer.n_vertices ()) +
                            " vertices and " + std::to_string (writer.n_indices ()) +
                            " indices are needed.");
    return RANGECAST_OK;
  });
}
