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

#include "common/elementproperties.hpp"
#include "common/streamlock.hpp"

#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <new>
#include <rangecast/base/guarded.hpp>
#include <rangecast/geometry/point_cloud.hpp>

GST_DEBUG_CATEGORY_STATIC (gst_ply_enc_debug);
#define GST_CAT_DEFAULT gst_ply_enc_debug

using rangecast::PointCloudFormat;

namespace {

/* Output formats that may be negotiated. */
enum class Choice { kAuto, kPly, kPcd };

struct PlyEncSettings {
  PointCloudFormat format; /* kind: not used */
  Choice choice = Choice::kAuto;
};

} // namespace

struct GstPlyEncPrivate {
  std::mutex lock; /* guards settings, choice, started */
  PlyEncSettings settings;
  Choice choice = Choice::kAuto; /* of the stream: settings.choice at start */
  bool started = false;

  /* streaming thread */
  PointCloudFormat::Kind kind = PointCloudFormat::kPly; /* of the output caps */
  gstrange::RangeInfo info;
  guint64 frames = 0; /* since start or flush */
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

static PointCloudFormat
current_format (GstPlyEncPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  PointCloudFormat format = priv->settings.format;
  format.kind = priv->kind;
  return format;
}

/* Of the output; PLY is the first where both are possible. */
static GstCaps *
possible_caps (GstPlyEncPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  switch (priv->started ? priv->choice : priv->settings.choice) {
    case Choice::kPly:
      return gst_caps_new_empty_simple ("application/x-ply");
    case Choice::kPcd:
      return gst_caps_new_empty_simple ("application/x-pcd");
    default:
      return gst_static_pad_template_get_caps (&src_template);
  }
}

static GstCaps *
gst_ply_enc_transform_caps (
    GstBaseTransform *base, GstPadDirection direction, GstCaps *, GstCaps *filter)
{
  GstCaps *other = direction == GST_PAD_SRC ? gst_static_pad_template_get_caps (&sink_template)
                                            : possible_caps (GST_PLY_ENC (base)->priv);
  if (!filter)
    return other;
  GstCaps *filtered = gst_caps_intersect_full (filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (other);
  return filtered;
}

/* `location` of the sink that is linked, as filesink and multifilesink have it; free with g_free().
 */
static gchar *
file_name_of_sink (GstBaseTransform *base)
{
  gchar *name = nullptr;
  GstPad *peer = gst_pad_get_peer (base->srcpad);
  GstElement *sink = peer ? gst_pad_get_parent_element (peer) : nullptr;
  GParamSpec *spec =
      sink ? g_object_class_find_property (G_OBJECT_GET_CLASS (sink), "location") : nullptr;
  if (spec && spec->value_type == G_TYPE_STRING && (spec->flags & G_PARAM_READABLE))
    g_object_get (sink, "location", &name, nullptr);
  gst_clear_object (&sink);
  gst_clear_object (&peer);
  return name;
}

static void
warn_of_other_name (GstPlyEnc *self)
{
  const bool pcd = self->priv->kind == PointCloudFormat::kPcd;
  gchar *name = file_name_of_sink (GST_BASE_TRANSFORM (self));
  if (name && g_str_has_suffix (name, pcd ? ".ply" : ".pcd"))
    GST_ELEMENT_WARNING (self, STREAM, FORMAT,
        ("%s is written as %s; expected format=%s, or another name", name, pcd ? "PCD" : "PLY",
            pcd ? "ply" : "pcd"),
        (nullptr));
  g_free (name);
}

static gboolean
gst_ply_enc_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_PLY_ENC (base);
  GST_INFO_OBJECT (self, "caps %" GST_PTR_FORMAT " -> %" GST_PTR_FORMAT, in, out);
  self->priv->kind = gst_structure_has_name (gst_caps_get_structure (out, 0), "application/x-pcd")
                         ? PointCloudFormat::kPcd
                         : PointCloudFormat::kPly;
  warn_of_other_name (self);
  const rangecast::Status status =
      rangecast::guarded ("plyenc", [&] { return gstrange::parse_caps (in, self->priv->info); });
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* Writes the file into a new buffer. */
static rangecast::Status
write_file (GstPlyEnc *self, GstBuffer *input, GstBuffer *&output)
{
  const gstrange::RangeFrameMap frame (input, GST_MAP_READ);
  if (!frame.status ().ok ())
    return frame.status ();
  const rangecast::PointCloudWriter writer (current_format (self->priv));
  std::size_t points = 0;
  for (const auto &view : frame.views ())
    points += rangecast::count_points (view);
  GST_LOG_OBJECT (self, "%zu points, %zu bytes", points, writer.size (points));
  output = gst_buffer_new_allocate (nullptr, writer.size (points), nullptr);
  GstMapInfo map;
  if (!output || !gst_buffer_map (output, &map, GST_MAP_WRITE))
    throw std::bad_alloc ();
  const auto unmap = [&] (GstBuffer *buffer) { gst_buffer_unmap (buffer, &map); };
  const std::unique_ptr<GstBuffer, decltype (unmap)> mapped (output, unmap);
  return writer.write (frame.views (), self->priv->info.rig, {map.data, map.size});
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

/* Writes the file, too: the buffer's size depends on the number of points. */
static GstFlowReturn
gst_ply_enc_prepare_output_buffer (GstBaseTransform *base, GstBuffer *input, GstBuffer **output)
{
  auto self = GST_PLY_ENC (base);
  GstPlyEncPrivate *priv = self->priv;
  if (priv->frames++ == 1 && is_one_file (base)) {
    GST_ELEMENT_ERROR (self, STREAM, WRONG_TYPE,
        ("a second point cloud would go into the file of the first; expected multifilesink "
         "location=cloud-%%05d.ply, or a stream of one frame set"),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  GstBuffer *buffer = nullptr;
  const rangecast::Status status =
      rangecast::guarded ("plyenc", [&] { return write_file (self, input, buffer); });
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

/* Only the capture time applies to a file. */
static gboolean
gst_ply_enc_transform_meta (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/* ---- lifecycle ---- */

static gboolean
gst_ply_enc_start (GstBaseTransform *base)
{
  GstPlyEncPrivate *priv = GST_PLY_ENC (base)->priv;
  priv->frames = 0;
  std::lock_guard guard (priv->lock);
  priv->choice = priv->settings.choice;
  priv->started = true;
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
  GstPlyEncPrivate *priv = GST_PLY_ENC (base)->priv;
  {
    const StreamLock lock (base);
    priv->info = {};
  }
  std::lock_guard guard (priv->lock);
  priv->started = false;
  return TRUE;
}

#define GST_TYPE_PLY_ENC_FORMAT (gst_ply_enc_format_get_type ())
static GType
gst_ply_enc_format_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (Choice::kAuto), "As downstream's caps name it, else PLY", "auto"},
        {int (Choice::kPly), "PLY, binary", "ply"},
        {int (Choice::kPcd), "Binary PCD 0.7 (Point Cloud Library)", "pcd"}, {}};
    return g_enum_register_static ("GstPlyEncFormat", values);
  }();
  return type;
}

static PropertyTable<PlyEncSettings> &
ply_enc_properties ()
{
  using S = PlyEncSettings;
  using F = PointCloudFormat;
  using P = PropertyTable<S>;
  static P table = {
      P::boolean<&S::format, &F::with_view_id> ("view-id", "View ID",
          "Write the view-id of each point as property view_id", kMutablePlaying),
      P::boolean<&S::format, &F::with_normals> ("normals", "Normals",
          "Write a unit normal for each point, estimated from the neighbouring pixels",
          kMutablePlaying),
      P::enumeration<&S::choice> (
          "format", "Format", "Output file format", GST_TYPE_PLY_ENC_FORMAT, kMutableReady),
  };
  return table;
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

  GST_DEBUG_CATEGORY_INIT (gst_ply_enc_debug, "plyenc", 0, "PLY encoder");

  object_class->finalize = gst_ply_enc_finalize;
  install_properties<GstPlyEnc, ply_enc_properties> (object_class);

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "PLY encoder", "Encoder/Image",
      "Encodes each range frame set as a binary PLY or PCD point cloud", "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_ply_enc_start);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_ply_enc_sink_event);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_ply_enc_stop);
  transform_class->transform_caps = GST_DEBUG_FUNCPTR (gst_ply_enc_transform_caps);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_ply_enc_set_caps);
  transform_class->prepare_output_buffer = GST_DEBUG_FUNCPTR (gst_ply_enc_prepare_output_buffer);
  transform_class->transform = GST_DEBUG_FUNCPTR (gst_ply_enc_transform);
  transform_class->transform_meta = GST_DEBUG_FUNCPTR (gst_ply_enc_transform_meta);
}
