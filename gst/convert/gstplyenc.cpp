/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-plyenc
 * @title: plyenc
 *
 * Encodes each frame set as a point cloud: one binary PLY file per buffer, in world coordinates and
 * metres, for multifilesink. If downstream requires model/gltf-binary, it is a mesh in a binary
 * glTF 2.0 file.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=1 ! plyenc ! multifilesink location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include "common/basetransform.hpp"
#include "common/elementproperties.hpp"

#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <rangecast/geometry/glb.hpp>
#include <rangecast/geometry/point_cloud.hpp>
#include <vector>

GST_DEBUG_CATEGORY_STATIC (gst_ply_enc_debug);
#define GST_CAT_DEFAULT gst_ply_enc_debug

using rangecast::PointCloudFormat;

struct GstPlyEncPrivate {
  std::mutex lock; /* guards settings */
  PointCloudFormat settings;

  /* streaming thread */
  gstrange::RangeInfo info;
  bool is_glb = false; /* the output */
  guint64 frames = 0;  /* since start or flush */
};

DECLARE_ELEMENT (GstPlyEnc, gst_ply_enc, PLY_ENC, GstBaseTransform)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-ply; model/gltf-binary"));

G_DEFINE_TYPE (GstPlyEnc, gst_ply_enc, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (plyenc, "plyenc", GST_RANK_NONE, gst_ply_enc_get_type ())

static GstCaps *
gst_ply_enc_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *, GstCaps *filter)
{
  GstCaps *other =
      gst_static_pad_template_get_caps (direction == GST_PAD_SRC ? &sink_template : &src_template);
  if (!filter)
    return other;
  GstCaps *filtered = gst_caps_intersect_full (filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (other);
  return filtered;
}

static gboolean
gst_ply_enc_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_PLY_ENC (base);
  GST_INFO_OBJECT (self, "caps %" GST_PTR_FORMAT " -> %" GST_PTR_FORMAT, in, out);
  self->priv->is_glb =
      gst_structure_has_name (gst_caps_get_structure (out, 0), "model/gltf-binary");
  const rangecast::Status status = gstrange::parse_caps (in, self->priv->info);
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* Whether downstream, a filesink for example, puts all buffers into one file. */
static bool
is_one_file (GstBaseTransform *base)
{
  bool bytes = false;
  GstQuery *query = gst_query_new_formats ();
  guint count = 0;
  if (gst_pad_peer_query (base->srcpad, query))
    gst_query_parse_n_formats (query, &count);
  for (guint i = 0; i < count; i++) {
    GstFormat format = GST_FORMAT_UNDEFINED;
    gst_query_parse_nth_format (query, i, &format);
    bytes |= format == GST_FORMAT_BYTES;
  }
  gst_query_unref (query);
  return bytes;
}

/* Writes the file into a new buffer. */
static rangecast::Status
write_file (GstPlyEnc *self, GstBuffer *input, GstBuffer *&output)
{
  const gstrange::RangeFrameMap frame (input, GST_MAP_READ);
  if (!frame.status ().ok ())
    return frame.status ();
  std::size_t points = 0;
  for (const auto &view : frame.views ())
    points += rangecast::count_points (view);
  if (points == 0 && is_one_file (GST_BASE_TRANSFORM (self)))
    return {
        rangecast::StatusCode::kBadData, "the frame set has no points: the file would be empty"};
  if (self->priv->is_glb) {
    auto file = std::make_unique<std::vector<guint8>> ();
    const auto status = rangecast::write_glb (frame.views (), self->priv->info.rig, *file);
    if (!status.ok ())
      return status;
    std::vector<guint8> &bytes = *file;
    output = gst_buffer_new_wrapped_full (GstMemoryFlags (0), bytes.data (), bytes.size (), 0,
        bytes.size (), file.release (),
        [] (gpointer vector) { delete static_cast<std::vector<guint8> *> (vector); });
    return status;
  }
  const rangecast::PointCloudWriter writer (settings_of (self->priv));
  GST_LOG_OBJECT (self, "%zu points, %zu bytes", points, writer.size (points));
  output = gst_buffer_new_allocate (nullptr, writer.size (points), nullptr);
  GstMapInfo map;
  gst_buffer_map (output, &map, GST_MAP_WRITE);
  const rangecast::Status status =
      writer.write (frame.views (), self->priv->info.rig, {map.data, map.size});
  gst_buffer_unmap (output, &map);
  return status;
}

/* Writes the file, too: the buffer's size depends on the number of points. */
static GstFlowReturn
gst_ply_enc_prepare_output_buffer (GstBaseTransform *base, GstBuffer *input, GstBuffer **output)
{
  auto self = GST_PLY_ENC (base);
  GstPlyEncPrivate *priv = self->priv;
  if (priv->frames++ == 1 && is_one_file (base)) {
    GST_ELEMENT_ERROR (self, STREAM, WRONG_TYPE,
        ("a second point cloud would go into the file of the first; use multifilesink "
         "location=cloud-%%05d.%s, or send one frame set",
            priv->is_glb ? "glb" : "ply"),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  GstBuffer *buffer = nullptr;
  const rangecast::Status status = write_file (self, input, buffer);
  if (!status.ok ()) {
    gst_clear_buffer (&buffer);
    return gst_range_flow_return (GST_ELEMENT (self), status);
  }
  GST_BASE_TRANSFORM_GET_CLASS (base)->copy_metadata (base, input, buffer);
  *output = buffer;
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_ply_enc_transform (GstBaseTransform *, GstBuffer *, GstBuffer *)
{
  return GST_FLOW_OK; /* prepare_output_buffer() has done it */
}

/* ---- lifecycle ---- */

static gboolean
gst_ply_enc_start (GstBaseTransform *base)
{
  GST_PLY_ENC (base)->priv->frames = 0;
  return TRUE;
}

/* Sinks of one file start it again at a flush. */
static gboolean
gst_ply_enc_sink_event (GstBaseTransform *base, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP)
    GST_PLY_ENC (base)->priv->frames = 0;
  return GST_BASE_TRANSFORM_CLASS (gst_ply_enc_parent_class)->sink_event (base, event);
}

static gboolean
gst_ply_enc_stop (GstBaseTransform *base)
{
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  GST_PLY_ENC (base)->priv->info = {};
  return TRUE;
}

static PropertyTable<PointCloudFormat> &
ply_enc_properties ()
{
  using S = PointCloudFormat;
  using P = PropertyTable<S>;
  static P table = {
      P::boolean<&S::with_view_id> ("view-id", "View ID",
          "Write the view-id of each point as property view_id", kMutablePlaying),
      P::boolean<&S::with_normals> ("normals", "Normals",
          "Write a unit normal for each point, estimated from the neighbouring pixels",
          kMutablePlaying),
  };
  return table;
}

static void
gst_ply_enc_init (GstPlyEnc *self)
{
  self->priv = new GstPlyEncPrivate;
}

static void
gst_ply_enc_class_init (GstPlyEncClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_ply_enc_debug, "plyenc", 0, "PLY encoder");

  object_class->finalize = delete_private<GstPlyEnc>;
  install_properties<GstPlyEnc, ply_enc_properties> (object_class);

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "PLY encoder", "Encoder/Image",
      "Encodes each range frame set as a binary PLY point cloud", "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_ply_enc_start);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_ply_enc_sink_event);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_ply_enc_stop);
  transform_class->transform_caps = GST_DEBUG_FUNCPTR (gst_ply_enc_transform_caps);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_ply_enc_set_caps);
  transform_class->prepare_output_buffer = GST_DEBUG_FUNCPTR (gst_ply_enc_prepare_output_buffer);
  transform_class->transform = GST_DEBUG_FUNCPTR (gst_ply_enc_transform);
  transform_class->transform_meta = GST_DEBUG_FUNCPTR (keep_capture_time);
}
