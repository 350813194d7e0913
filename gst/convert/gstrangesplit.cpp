/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangesplit
 * @title: rangesplit
 *
 * Converts single views to depth and colour video, at the full size of the view. Request pads:
 * `depth` and `colour` of the rig's first view, `depth_%u` and `colour_%u` of the view with that
 * id. Depth is GRAY16_LE or GRAY16_BE, as downstream takes it, or a picture to look at
 * (#GstRangeSplit:depth-map).
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=100 ! rangesplit name=s s.colour ! videoconvert ! \
 *   autovideosink s.depth_1 ! queue ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include "common/bufferpools.hpp"
#include "common/elementproperties.hpp"

#include <gst/base/gstflowcombiner.h>
#include <gst/video/gstvideopool.h>
#include <gst/video/video.h>

#include <algorithm>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <rangecast/geometry/paste.hpp>
#include <rangecast/geometry/point_cloud.hpp>
#include <vector>

using rangecast::ConstRangeImage;
using rangecast::ImageView;
using rangecast::Rgbx;
using rangecast::View;

GST_DEBUG_CATEGORY_STATIC (gst_range_split_debug);
#define GST_CAT_DEFAULT gst_range_split_debug

namespace {

constexpr int kFirstView = -1;

/* What depth pads show. */
enum class DepthMap { kNone, kGrey, kTurbo };

struct SplitSettings {
  bool mask = true;
  DepthMap depth_map = DepthMap::kNone;
};

/* A request pad and its stream. The members below view_id belong to the streaming thread, which
 * keeps a reference while it uses them. */
struct SplitPad {
  GstPad *pad;
  bool depth;  /* else colour */
  int view_id; /* or kFirstView */

  bool needs_start = true, needs_caps = true, needs_segment = true;
  bool refused = false;  /* downstream's refusal of these caps has been posted */
  int current_view = -1; /* of the caps */
  DepthMap current_map = DepthMap::kNone;
  GstVideoInfo video;
  GstBufferPool *pool = nullptr;

  SplitPad (GstPad *p, bool is_depth, int id)
      : pad (GST_PAD (gst_object_ref (p))), depth (is_depth), view_id (id)
  {
  }
  ~SplitPad ()
  {
    drop_pool (pool);
    gst_object_unref (pad);
  }
};
using SplitPads = std::vector<std::shared_ptr<SplitPad>>;

} // namespace

struct GstRangeSplitPrivate {
  std::mutex lock; /* guards settings, pads, combiner; never held across a push, query or message */
  SplitSettings settings;
  SplitPads pads;
  GstFlowCombiner *combiner = gst_flow_combiner_new ();

  /* streaming thread */
  gstrange::RangeInfo info;
  GstSegment segment;
  guint group_id = GST_GROUP_ID_INVALID;

  ~GstRangeSplitPrivate () { gst_flow_combiner_free (combiner); }
};

DECLARE_ELEMENT (GstRangeSplit, gst_range_split, RANGE_SPLIT, GstElement)

#define DEPTH_CAPS GST_VIDEO_CAPS_MAKE ("{ GRAY16_LE, GRAY16_BE, GRAY8, RGBx }")
#define COLOUR_CAPS GST_VIDEO_CAPS_MAKE ("RGBx")

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate depth_template =
    GST_STATIC_PAD_TEMPLATE ("depth", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (DEPTH_CAPS));
static GstStaticPadTemplate colour_template =
    GST_STATIC_PAD_TEMPLATE ("colour", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (COLOUR_CAPS));
static GstStaticPadTemplate depth_of_template = GST_STATIC_PAD_TEMPLATE (
    "depth_%u", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (DEPTH_CAPS));
static GstStaticPadTemplate colour_of_template = GST_STATIC_PAD_TEMPLATE (
    "colour_%u", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (COLOUR_CAPS));

G_DEFINE_TYPE (GstRangeSplit, gst_range_split, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (rangesplit, "rangesplit", GST_RANK_NONE, gst_range_split_get_type ())

/* ---- negotiation of one pad ---- */

static SplitPads
current_pads (GstRangeSplit *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->pads;
}

static bool
set_up_pool (SplitPad &pad, GstCaps *caps)
{
  guint size = static_cast<guint> (GST_VIDEO_INFO_SIZE (&pad.video)), min = 0, max = 0;
  GstQuery *query = gst_query_new_allocation (caps, TRUE);
  drop_pool (pad.pool);
  gst_pad_peer_query (pad.pad, query);
  if (gst_query_get_n_allocation_pools (query) > 0)
    gst_query_parse_nth_allocation_pool (query, 0, &pad.pool, &size, &min, &max);
  const bool video_meta = gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr);
  gst_query_unref (query);
  if (!pad.pool)
    pad.pool = gst_video_buffer_pool_new ();

  GstStructure *config = gst_buffer_pool_get_config (pad.pool);
  gst_buffer_pool_config_set_params (
      config, caps, MAX (size, static_cast<guint> (GST_VIDEO_INFO_SIZE (&pad.video))), min, max);
  if (video_meta)
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  return gst_buffer_pool_set_config (pad.pool, config) &&
         gst_buffer_pool_set_active (pad.pool, TRUE);
}

/* Of 16-bit depth, the byte order that downstream takes; GRAY16_LE if it takes both. */
static GstVideoFormat
choose_format (const SplitPad &pad, DepthMap map)
{
  if (!pad.depth || map == DepthMap::kTurbo)
    return GST_VIDEO_FORMAT_RGBx;
  if (map == DepthMap::kGrey)
    return GST_VIDEO_FORMAT_GRAY8;
  GstCaps *little = gst_caps_from_string (GST_VIDEO_CAPS_MAKE ("GRAY16_LE"));
  GstCaps *big = gst_caps_from_string (GST_VIDEO_CAPS_MAKE ("GRAY16_BE"));
  GstCaps *taken = gst_pad_peer_query_caps (pad.pad, nullptr);
  const bool swap = !gst_caps_can_intersect (little, taken) && gst_caps_can_intersect (big, taken);
  for (GstCaps *caps : {little, big, taken})
    gst_caps_unref (caps);
  return swap ? GST_VIDEO_FORMAT_GRAY16_BE : GST_VIDEO_FORMAT_GRAY16_LE;
}

static bool
push_caps (GstRangeSplit *self, SplitPad &pad, const View &view, DepthMap map)
{
  const gstrange::RangeInfo &info = self->priv->info;
  gst_video_info_set_format (
      &pad.video, choose_format (pad, map), guint (view.width), guint (view.height));
  pad.video.fps_n = info.fps_n;
  pad.video.fps_d = info.fps_d;
  GstCaps *caps = gst_video_info_to_caps (&pad.video);
  if (!pad.depth || map == DepthMap::kNone)
    gstrange::set_view (caps, view);
  GST_INFO_OBJECT (pad.pad, "view %d, caps %" GST_PTR_FORMAT, view.id, caps);
  /* Asked first, because pushing a sticky event succeeds even if the peer refuses it. */
  const bool refused = gst_pad_is_linked (pad.pad) && !GST_PAD_IS_FLUSHING (pad.pad) &&
                       !gst_pad_peer_query_accept_caps (pad.pad, caps);
  const bool accepted = !refused && gst_pad_push_event (pad.pad, gst_event_new_caps (caps)) &&
                        set_up_pool (pad, caps);
  gst_caps_unref (caps);
  if (refused && !pad.refused && !GST_PAD_IS_FLUSHING (pad.pad))
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION,
        ("pad %s: downstream does not accept %s%s", GST_PAD_NAME (pad.pad),
            gst_video_format_to_string (GST_VIDEO_INFO_FORMAT (&pad.video)),
            pad.depth && map == DepthMap::kNone ? "; depth has 16 bits; set depth-map for 8 bits"
                                                : ""),
        (nullptr));
  pad.refused = refused;
  pad.current_view = view.id;
  pad.current_map = map;
  if (!accepted)
    GST_DEBUG_OBJECT (pad.pad, "caps or pool refused downstream");
  return accepted;
}

/* Pushes the events that precede data on this pad, where needed: STREAM_START, CAPS, SEGMENT. */
static GstFlowReturn
make_ready (GstRangeSplit *self, SplitPad &pad, const SplitSettings &settings)
{
  const rangecast::Rig &rig = self->priv->info.rig;
  const View *view = pad.view_id == kFirstView ? &rig.views[0] : rig.find (pad.view_id);
  if (!view) {
    GST_ELEMENT_ERROR (self, LIBRARY, SETTINGS,
        ("pad %s: the stream's rig has no view %d", GST_PAD_NAME (pad.pad), pad.view_id),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  if (pad.needs_start) {
    gchar *id = gst_pad_create_stream_id (pad.pad, GST_ELEMENT (self), GST_PAD_NAME (pad.pad));
    GstEvent *event = gst_event_new_stream_start (id);
    if (self->priv->group_id != GST_GROUP_ID_INVALID)
      gst_event_set_group_id (event, self->priv->group_id);
    gst_pad_push_event (pad.pad, event);
    g_free (id);
    pad.needs_start = false;
  }
  if (gst_pad_check_reconfigure (pad.pad) || pad.needs_caps || pad.current_view != view->id ||
      (pad.depth && pad.current_map != settings.depth_map)) {
    if (!push_caps (self, pad, *view, settings.depth_map)) {
      gst_pad_mark_reconfigure (pad.pad);
      return GST_PAD_IS_FLUSHING (pad.pad) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
    }
    pad.needs_caps = false;
  }
  if (pad.needs_segment) {
    gst_pad_push_event (pad.pad, gst_event_new_segment (&self->priv->segment));
    pad.needs_segment = false;
  }
  return GST_FLOW_OK;
}

/* ---- data ---- */

static void
paste (const SplitPad &pad, const View &view, bool mask, const ConstRangeImage &image,
    GstVideoFrame &video)
{
  const auto plane = [&]<typename T> (T *pixels) {
    return ImageView<T>{pixels, GST_VIDEO_FRAME_WIDTH (&video), GST_VIDEO_FRAME_HEIGHT (&video),
        GST_VIDEO_FRAME_PLANE_STRIDE (&video, 0)};
  };
  void *data = GST_VIDEO_FRAME_PLANE_DATA (&video, 0);
  const auto grey = plane (static_cast<std::uint8_t *> (data));
  const auto depth = plane (static_cast<std::uint16_t *> (data));
  const auto colour = plane (static_cast<Rgbx *> (data));
  const std::uint16_t near = rangecast::depth_units (view.near_m, view.depth_unit_m),
                      far = rangecast::depth_units (view.far_m, view.depth_unit_m);
  if (!pad.depth)
    rangecast::paste_colour (image, mask, colour);
  else if (pad.current_map == DepthMap::kGrey)
    rangecast::paste_depth_map (image, near, far, grey);
  else if (pad.current_map == DepthMap::kTurbo)
    rangecast::paste_depth_map (image, near, far, colour);
  else
    rangecast::paste_depth (image, depth);
  if (GST_VIDEO_FRAME_FORMAT (&video) == GST_VIDEO_FORMAT_GRAY16_BE)
    rangecast::swap_bytes (depth, depth);
}

static GstFlowReturn
push_view (GstRangeSplit *self, SplitPad &pad, const SplitSettings &settings,
    const gstrange::RangeFrameMap &frame, GstBuffer *in)
{
  if (!gst_pad_is_linked (pad.pad))
    return GST_FLOW_NOT_LINKED;
  GstFlowReturn flow = make_ready (self, pad, settings);
  if (flow != GST_FLOW_OK)
    return flow;
  ConstRangeImage image; /* stays empty if the frame set lacks the view */
  for (const auto &view : frame.views ())
    if (view.view_id == pad.current_view)
      image = view;
  GST_LOG_OBJECT (
      pad.pad, "view %d, ROI %dx%d", pad.current_view, image.roi.width, image.roi.height);

  GstBuffer *out = nullptr;
  flow = gstrange::acquire (GST_ELEMENT (self), pad.pool, &out);
  if (flow != GST_FLOW_OK)
    return flow;
  GstVideoFrame video;
  if (!gst_video_frame_map (&video, &pad.video, out, GST_MAP_WRITE)) {
    gst_buffer_unref (out);
    GST_ELEMENT_ERROR (self, RESOURCE, WRITE, (nullptr), ("cannot map an output buffer"));
    return GST_FLOW_ERROR;
  }
  paste (pad, *self->priv->info.rig.find (pad.current_view), settings.mask, image, video);
  gst_video_frame_unmap (&video);
  gst_buffer_copy_into (
      out, in, GstBufferCopyFlags (GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS), 0, -1);
  gst_range_buffer_set_capture_time (out, gst_range_buffer_get_capture_time (in));
  return gst_pad_push (pad.pad, out);
}

static GstFlowReturn
gst_range_split_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RANGE_SPLIT (parent);
  GstFlowReturn flow = GST_FLOW_OK;
  if (self->priv->info.views () == 0) {
    gst_buffer_unref (buffer);
    return GST_FLOW_NOT_NEGOTIATED;
  }
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
    flow = gst_range_flow_return (GST_ELEMENT (self), frame.status ());
    const SplitSettings settings = settings_of (self->priv);
    for (const auto &pad : flow == GST_FLOW_OK ? current_pads (self) : SplitPads{}) {
      const GstFlowReturn pushed = push_view (self, *pad, settings, frame, buffer);
      std::lock_guard guard (self->priv->lock);
      /* Ignore the FLUSHING of a pad that was released meanwhile, which the combiner would return
       * although it does not know the pad. */
      if (std::ranges::find (self->priv->pads, pad) == self->priv->pads.end ())
        continue;
      flow = gst_flow_combiner_update_pad_flow (self->priv->combiner, pad->pad, pushed);
      if (flow != GST_FLOW_OK)
        break;
    }
  }
  gst_buffer_unref (buffer);
  return flow;
}

/* ---- events ---- */

static gboolean
handle_caps (GstRangeSplit *self, GstEvent *event)
{
  GstCaps *caps;
  gst_event_parse_caps (event, &caps);
  const rangecast::Status status = gstrange::parse_caps (caps, self->priv->info);
  gst_event_unref (event);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  GST_INFO_OBJECT (self, "caps: %d views, %dx%d", self->priv->info.views (), self->priv->info.width,
      self->priv->info.height);
  for (const auto &pad : current_pads (self))
    pad->needs_caps = true;
  return TRUE;
}

static gboolean
gst_range_split_sink_event (GstPad *sink, GstObject *parent, GstEvent *event)
{
  auto self = GST_RANGE_SPLIT (parent);
  const SplitPads pads = current_pads (self);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_CAPS:
      return handle_caps (self, event);
    case GST_EVENT_STREAM_START:
      if (!gst_event_parse_group_id (event, &self->priv->group_id))
        self->priv->group_id = GST_GROUP_ID_INVALID;
      for (const auto &pad : pads)
        pad->needs_start = pad->needs_segment = true;
      gst_event_unref (event);
      return TRUE;
    case GST_EVENT_SEGMENT:
      gst_event_copy_segment (event, &self->priv->segment);
      for (const auto &pad : pads)
        pad->needs_segment = true;
      gst_event_unref (event);
      return TRUE;
    case GST_EVENT_FLUSH_STOP: {
      std::lock_guard guard (self->priv->lock);
      gst_flow_combiner_reset (self->priv->combiner);
      for (const auto &pad : pads)
        pad->needs_segment = true;
      break;
    }
    case GST_EVENT_EOS:
    case GST_EVENT_GAP:
      for (const auto &pad : pads)
        if (self->priv->info.views () > 0)
          make_ready (self, *pad, settings_of (self->priv));
      break;
    default:
      break;
  }
  return gst_pad_event_default (sink, parent, event);
}

/* ---- request pads ---- */

static GstPad *
gst_range_split_request_new_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *name, const GstCaps *)
{
  auto self = GST_RANGE_SPLIT (element);
  const gchar *kind = GST_PAD_TEMPLATE_NAME_TEMPLATE (pad_template);
  const bool depth = g_str_has_prefix (kind, "depth");
  int view_id = kFirstView;
  gchar *pad_name = nullptr;
  if (g_str_has_suffix (kind, "_%u")) {
    const gchar *digits = name ? strchr (name, '_') : nullptr;
    guint64 id = 0;
    if (digits && !g_ascii_string_to_unsigned (
                      digits + 1, 10, 0, guint64 (rangecast::kMaxViews - 1), &id, nullptr)) {
      GST_ERROR_OBJECT (self, "pad %s: needs a view-id of 0 to 63", name);
      return nullptr;
    }
    view_id = static_cast<int> (id);
    pad_name = g_strdup_printf ("%s_%d", depth ? "depth" : "colour", view_id);
  } else {
    pad_name = g_strdup (kind);
  }

  GstPad *pad = gst_pad_new_from_template (pad_template, pad_name);
  g_free (pad_name);
  gst_pad_set_active (pad, TRUE);
  if (!gst_element_add_pad (element, pad)) /* warns that the name is taken */
    return nullptr;
  std::lock_guard guard (self->priv->lock);
  self->priv->pads.push_back (std::make_shared<SplitPad> (pad, depth, view_id));
  gst_flow_combiner_add_pad (self->priv->combiner, pad);
  return pad;
}

static void
gst_range_split_release_pad (GstElement *element, GstPad *pad)
{
  auto self = GST_RANGE_SPLIT (element);
  { /* before deactivation, so that chain() ignores the flow return of a push that this ends */
    std::lock_guard guard (self->priv->lock);
    std::erase_if (self->priv->pads, [&] (const auto &entry) { return entry->pad == pad; });
    gst_flow_combiner_remove_pad (self->priv->combiner, pad);
  }
  gst_pad_set_active (pad, FALSE);
  gst_element_remove_pad (element, pad);
}

/* ---- lifecycle ---- */

static GstStateChangeReturn
gst_range_split_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_RANGE_SPLIT (element);
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_range_split_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) { /* pads are inactive: nobody streams */
    std::lock_guard guard (self->priv->lock);
    self->priv->info = {};
    self->priv->group_id = GST_GROUP_ID_INVALID;
    gst_segment_init (&self->priv->segment, GST_FORMAT_TIME);
    gst_flow_combiner_reset (self->priv->combiner);
    for (const auto &pad : self->priv->pads) {
      drop_pool (pad->pool);
      pad->needs_start = pad->needs_caps = pad->needs_segment = true;
      pad->refused = false;
    }
  }
  return result;
}

static const GEnumValue kDepthMaps[] = {
    {int (DepthMap::kNone), "Depth units, 16 bits (0 = invalid)", "none"},
    {int (DepthMap::kGrey), "8 bits, white at near, dark at far, black where invalid", "grey"},
    {int (DepthMap::kTurbo), "Colours, red at near, blue at far, black where invalid", "turbo"},
    {}};

static PropertyTable<SplitSettings> &
split_properties ()
{
  using S = SplitSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::enumeration<&S::depth_map> ("depth-map", "Depth map", "What depth pads show",
          "GstRangeSplitDepthMap", kDepthMaps, kMutablePlaying),
      P::boolean<&S::mask> (
          "mask", "Mask colour", "Make colour black where depth is invalid", kMutablePlaying),
  };
  return table;
}

static void
gst_range_split_init (GstRangeSplit *self)
{
  self->priv = new GstRangeSplitPrivate;
  gst_segment_init (&self->priv->segment, GST_FORMAT_TIME);
  GstPad *sink = gst_pad_new_from_static_template (&sink_template, "sink");
  gst_pad_set_chain_function (sink, GST_DEBUG_FUNCPTR (gst_range_split_chain));
  gst_pad_set_event_function (sink, GST_DEBUG_FUNCPTR (gst_range_split_sink_event));
  gst_element_add_pad (GST_ELEMENT (self), sink);
}

static void
gst_range_split_class_init (GstRangeSplitClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_range_split_debug, "rangesplit", 0, "Range image splitter");

  object_class->finalize = delete_private<GstRangeSplit>;
  install_properties<GstRangeSplit, split_properties> (object_class);

  for (GstStaticPadTemplate *pad_template :
      {&sink_template, &depth_template, &colour_template, &depth_of_template, &colour_of_template})
    gst_element_class_add_static_pad_template (element_class, pad_template);
  gst_element_class_set_static_metadata (element_class, "Range image splitter", "Filter/Video",
      "Converts single views of range frame sets to depth and colour video; each pad needs a queue",
      "gst-rangecast");

  element_class->request_new_pad = GST_DEBUG_FUNCPTR (gst_range_split_request_new_pad);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_range_split_release_pad);
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_range_split_change_state);
}
