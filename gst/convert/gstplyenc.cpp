/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-plyenc
 * @title: plyenc
 *
 * Encodes each frame set as a point cloud: one binary PLY or PCD file per buffer, in world
 * coordinates and metres, for multifilesink.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=1 ! plyenc ! multifilesink location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include "gstplyenc.h"

#include <atomic>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <new>
#include <rangecast/base/guarded.hpp>
#include <rangecast/geometry/point_cloud.hpp>

#include "common/properties.hpp"
#include "common/streamlock.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_ply_enc_debug);
#define GST_CAT_DEFAULT gst_ply_enc_debug

enum { PROP_0, PROP_VIEW_ID, PROP_NORMALS, PROP_FORMAT };

using rangecast::PointCloudFormat;

struct GstPlyEncPrivate {
  std::atomic<bool> with_view_id{false}, with_normals{false};
  std::atomic<PointCloudFormat::Kind> kind{PointCloudFormat::kPly}; /* as the application wants */
  /* What the stream's caps say, and with them its files: `kind` as it was in READY. */
  std::atomic<PointCloudFormat::Kind> kind_of_stream{PointCloudFormat::kPly};
  std::atomic<bool> started{false};
  gstrange::RangeInfo info; /* streaming thread only */
};

struct _GstPlyEnc {
  GstBaseTransform parent;
  GstPlyEncPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-ply; application/x-pcd"));

G_DEFINE_TYPE (GstPlyEnc, gst_ply_enc, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (plyenc, "plyenc", GST_RANK_NONE, GST_TYPE_PLY_ENC)

#define GST_TYPE_PLY_ENC_FORMAT (gst_ply_enc_format_get_type ())
static GType
gst_ply_enc_format_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{PointCloudFormat::kPly, "PLY, binary", "ply"},
        {PointCloudFormat::kPcd, "Binary PCD 0.7 (Point Cloud Library)", "pcd"}, {}};
    return g_enum_register_static ("GstPlyEncFormat", values);
  }();
  return type;
}

/* ---- streaming ---- */

static PointCloudFormat::Kind
gst_ply_enc_kind (const GstPlyEncPrivate *priv)
{
  return priv->started ? priv->kind_of_stream : priv->kind;
}

static GstCaps *
gst_ply_enc_transform_caps (
    GstBaseTransform *base, GstPadDirection direction, GstCaps *, GstCaps *filter)
{
  const bool is_pcd = gst_ply_enc_kind (GST_PLY_ENC (base)->priv) == PointCloudFormat::kPcd;
  GstCaps *other =
      direction == GST_PAD_SRC
          ? gst_static_pad_template_get_caps (&sink_template)
          : gst_caps_new_empty_simple (is_pcd ? "application/x-pcd" : "application/x-ply");
  if (!filter)
    return other;
  GstCaps *filtered = gst_caps_intersect_full (filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (other);
  return filtered;
}

static gboolean
gst_ply_enc_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *)
{
  auto self = GST_PLY_ENC (base);
  const rangecast::Status status =
      rangecast::guarded ("plyenc", [&] { return gstrange::parse_caps (in, self->priv->info); });
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* A buffer with the file in it. */
static rangecast::Status
gst_ply_enc_write (GstPlyEncPrivate *priv, GstBuffer *input, GstBuffer *&output)
{
  const gstrange::RangeFrameMap frame (input, GST_MAP_READ);
  if (!frame.status ().ok ())
    return frame.status ();
  const rangecast::PointCloudWriter writer (
      {gst_ply_enc_kind (priv), priv->with_normals, priv->with_view_id});
  std::size_t points = 0;
  for (const auto &view : frame.views ())
    points += rangecast::count_points (view);
  output = gst_buffer_new_allocate (nullptr, writer.size (points), nullptr);
  GstMapInfo map;
  if (!output || !gst_buffer_map (output, &map, GST_MAP_WRITE))
    throw std::bad_alloc ();
  const auto unmap = [&] (GstBuffer *buffer) { gst_buffer_unmap (buffer, &map); };
  const std::unique_ptr<GstBuffer, decltype (unmap)> mapped (output, unmap);
  return writer.write (frame.views (), priv->info.rig, {map.data, map.size});
}

/* The output's size depends on the points, so the file is written here, where its buffer is made.
 */
static GstFlowReturn
gst_ply_enc_prepare_output_buffer (GstBaseTransform *base, GstBuffer *input, GstBuffer **output)
{
  auto self = GST_PLY_ENC (base);
  GstBuffer *buffer = nullptr;
  const rangecast::Status status =
      rangecast::guarded ("plyenc", [&] { return gst_ply_enc_write (self->priv, input, buffer); });
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
  return GST_FLOW_OK; /* prepare_output_buffer has written it */
}

/* The views' places mean nothing in such a file; when they were taken still does. */
static gboolean
gst_ply_enc_transform_meta (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/* ---- life ---- */

static gboolean
gst_ply_enc_start (GstBaseTransform *base)
{
  GstPlyEncPrivate *priv = GST_PLY_ENC (base)->priv;
  priv->kind_of_stream = priv->kind.load ();
  priv->started = true;
  return TRUE;
}

static gboolean
gst_ply_enc_stop (GstBaseTransform *base)
{
  GstPlyEncPrivate *priv = GST_PLY_ENC (base)->priv;
  const StreamLock lock (base);
  priv->started = false;
  priv->info = {};
  return TRUE;
}

static void
gst_ply_enc_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstPlyEncPrivate *priv = GST_PLY_ENC (object)->priv;
  switch (id) {
    case PROP_VIEW_ID:
      priv->with_view_id = g_value_get_boolean (value);
      break;
    case PROP_NORMALS:
      priv->with_normals = g_value_get_boolean (value);
      break;
    case PROP_FORMAT:
      priv->kind = PointCloudFormat::Kind (g_value_get_enum (value));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_ply_enc_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstPlyEncPrivate *priv = GST_PLY_ENC (object)->priv;
  switch (id) {
    case PROP_VIEW_ID:
      g_value_set_boolean (value, priv->with_view_id);
      break;
    case PROP_NORMALS:
      g_value_set_boolean (value, priv->with_normals);
      break;
    case PROP_FORMAT:
      g_value_set_enum (value, priv->kind);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_ply_enc_finalize (GObject *object)
{
  delete GST_PLY_ENC (object)->priv;
  G_OBJECT_CLASS (gst_ply_enc_parent_class)->finalize (object);
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

  object_class->set_property = gst_ply_enc_set_property;
  object_class->get_property = gst_ply_enc_get_property;
  object_class->finalize = gst_ply_enc_finalize;

  g_object_class_install_property (object_class, PROP_VIEW_ID,
      g_param_spec_boolean ("view-id", "View ID",
          "Write the view-id of each point as property view_id", FALSE, kMutablePlaying));
  g_object_class_install_property (object_class, PROP_NORMALS,
      g_param_spec_boolean ("normals", "Normals",
          "Write a unit normal for each point, estimated from the neighbouring pixels", FALSE,
          kMutablePlaying));
  g_object_class_install_property (object_class, PROP_FORMAT,
      g_param_spec_enum ("format", "Format", "Output file format", GST_TYPE_PLY_ENC_FORMAT,
          PointCloudFormat::kPly, kMutableReady));

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "PLY encoder", "Encoder/Image",
      "Encodes each range frame set as a binary PLY or PCD point cloud", "gst-rangecast");
  gst_type_mark_as_plugin_api (GST_TYPE_PLY_ENC_FORMAT, GstPluginAPIFlags (0));

  transform_class->start = gst_ply_enc_start;
  transform_class->stop = gst_ply_enc_stop;
  transform_class->transform_caps = gst_ply_enc_transform_caps;
  transform_class->set_caps = gst_ply_enc_set_caps;
  transform_class->prepare_output_buffer = gst_ply_enc_prepare_output_buffer;
  transform_class->transform = gst_ply_enc_transform;
  transform_class->transform_meta = gst_ply_enc_transform_meta;

  GST_DEBUG_CATEGORY_INIT (gst_ply_enc_debug, "plyenc", 0, "PLY encoder");
}
