/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any GstRangeMetas on buffers of any memories: refused, or mapped so that each row lies inside.
 * The bytes: how many memories (1 to 4) and how many views (0 to 7), in one; a size of 16 bits for
 * each memory; a Layout for each view. */
#include <gst/gst.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <span>

using Bytes = std::span<const guint8>;

struct Layout {
  guint32 view_id, x, y, width, height, depth_stride, colour_stride;
  guint64 depth_offset, colour_offset;
};

/* Whatever is missing at the end is 0. */
template <typename T>
static T
take (Bytes &bytes)
{
  T value{};
  const gsize size = std::min (sizeof value, bytes.size ());
  if (size)
    std::memcpy (&value, bytes.data (), size);
  bytes = bytes.subspan (size);
  return value;
}

static GstBuffer *
make_buffer (Bytes bytes)
{
  GstBuffer *buffer = gst_buffer_new ();
  const guint8 counts = take<guint8> (bytes);
  for (int i = 0; i <= (counts & 3); i++) {
    const gsize size = take<guint16> (bytes) % 4096;
    GstMemory *memory = gst_allocator_alloc (nullptr, size, nullptr);
    gst_buffer_append_memory (buffer, memory);
  }
  for (int i = 0; i < (counts >> 2 & 7); i++) {
    const auto layout = take<Layout> (bytes);
    auto meta = reinterpret_cast<GstRangeMeta *> (
        gst_buffer_add_meta (buffer, GST_RANGE_META_INFO, nullptr));
    meta->view_id = layout.view_id;
    meta->x = layout.x;
    meta->y = layout.y;
    meta->width = layout.width;
    meta->height = layout.height;
    meta->depth_stride = layout.depth_stride;
    meta->colour_stride = layout.colour_stride;
    meta->depth_offset = layout.depth_offset;
    meta->colour_offset = layout.colour_offset;
  }
  return buffer;
}

/* Reads and writes the ends of each row. */
static void
touch (const rangecast::RangeImage &image)
{
  for (int y = 0; y < image.roi.height; y++) {
    for (const int x : {0, image.roi.width - 1}) {
      image.depth.row (y)[x]++;
      image.colour.row (y)[x].b++;
    }
  }
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  if (!gst_is_initialized ())
    gst_init (nullptr, nullptr);
  GstBuffer *buffer = make_buffer ({data, size});
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    const std::size_t metas = gst_buffer_n_range_metas (buffer);
    const bool is_frame_set = metas > 0 || gst_buffer_get_size (buffer) == 0;
    if (frame.status ().ok () != (is_frame_set && frame.views ().size () == metas))
      std::abort ();
    for (std::size_t i = 0; i < frame.views ().size (); i++) {
      const rangecast::RangeImage image = frame.views ()[i];
      if (image.roi.empty ())
        continue;
      touch (image);
      frame.crop (
          i, {image.roi.x + image.roi.width / 2, image.roi.y + image.roi.height / 2,
                 image.roi.width - image.roi.width / 2, image.roi.height - image.roi.height / 2});
      touch (frame.views ()[i]);
    }
  }
  GstBuffer *both = gst_buffer_new ();
  if (gst_range_buffer_append (both, buffer)) {
    const gstrange::RangeFrameMap frame (both, GST_MAP_READ);
    (void)frame.views ().size ();
  }
  gst_buffer_unref (both);
  gst_buffer_unref (buffer);
  return 0;
}
