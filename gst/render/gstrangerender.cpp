/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangerender
 * @title: rangerender
 *
 * Renders range images as raw video: cylinderfilter, striprender and gldownload in one bin, which
 * playbin and decodebin plug as the decoder of range images. Pictures stay in OpenGL memory if
 * downstream accepts it. The elements inside are named `cylinder` and `render`; gst-launch-1.0 sets
 * their properties with names such as `render::auto-orbit=30`.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 playbin uri=file://$PWD/head.rcnc
 * ]|
 * |[
 * gst-launch-1.0 avatartestsrc ! rangerender render::auto-orbit=30 ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gstrangerender.h"

#include <gst/video/video.h>
#include <gstrange/gstrangecaps.h>

GST_DEBUG_CATEGORY_STATIC (gst_range_render_debug);
#define GST_CAT_DEFAULT gst_range_render_debug

struct _GstRangeRender {
  GstBin parent;
  const char *missing; /* factory of an element that could not be created */
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS,
        GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE_WITH_FEATURES (
            "memory:GLMemory", "RGBA") "; " GST_VIDEO_CAPS_MAKE ("RGBA")));

G_DEFINE_TYPE (GstRangeRender, gst_range_render, GST_TYPE_BIN)
/* SECONDARY suffices: no other element decodes range images. */
GST_ELEMENT_REGISTER_DEFINE (rangerender, "rangerender", GST_RANK_SECONDARY, GST_TYPE_RANGE_RENDER)

namespace {

GstElement *
add (GstRangeRender *self, const char *factory, const char *name)
{
  GstElement *element = gst_element_factory_make (factory, name);
  if (element)
    gst_bin_add (GST_BIN (self), element);
  else
    self->missing = factory;
  return element;
}

gboolean
is_no_range_of_rates (GQuark field, GValue *value, gpointer)
{
  return field != g_quark_from_static_string ("framerate") ||
         !GST_VALUE_HOLDS_FRACTION_RANGE (value);
}

/* Whether the ranges of frame rates in the caps together reach from 0 to the maximum. */
bool
has_all_rates (const GstCaps *caps)
{
  bool from_none = false, to_all = false;
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    const GValue *rate = gst_structure_get_value (gst_caps_get_structure (caps, i), "framerate");
    if (!rate || !GST_VALUE_HOLDS_FRACTION_RANGE (rate))
      continue;
    const GValue *min = gst_value_get_fraction_range_min (rate),
                 *max = gst_value_get_fraction_range_max (rate);
    from_none |= gst_value_get_fraction_numerator (min) == 0;
    to_all |= gst_value_get_fraction_numerator (max) == G_MAXINT &&
              gst_value_get_fraction_denominator (max) == 1;
  }
  return from_none && to_all;
}

/* playsink's deinterlace accepts frame rates [ 0, max/2 ] and [ max/2, max ]. gldownload puts both
 * together, which GStreamer 1.22 does not take for a subset of [ 0, max ], so that every
 * GstBaseTransform upstream warns. Ranges that are no limit are therefore removed. */
gboolean
query_downstream (GstPad *pad, GstObject *parent, GstQuery *query)
{
  const gboolean answered = gst_pad_query_default (pad, parent, query);
  if (!answered || GST_QUERY_TYPE (query) != GST_QUERY_CAPS)
    return answered;
  GstCaps *filter = nullptr, *caps = nullptr;
  gst_query_parse_caps (query, &filter);
  gst_query_parse_caps_result (query, &caps);
  caps = gst_caps_copy (caps);
  const bool unlimited = has_all_rates (caps);
  for (guint i = 0; unlimited && i < gst_caps_get_size (caps); i++)
    gst_structure_filter_and_map_in_place (
        gst_caps_get_structure (caps, i), is_no_range_of_rates, nullptr);
  if (filter) {
    GstCaps *wanted = gst_caps_intersect_full (filter, caps, GST_CAPS_INTERSECT_FIRST);
    gst_caps_unref (caps);
    caps = wanted;
  }
  gst_query_set_caps_result (query, caps);
  gst_caps_unref (caps);
  return TRUE;
}

GstPad *
add_ghost_pad (
    GstRangeRender *self, GstElement *element, const char *name, GstStaticPadTemplate *ghost)
{
  GstPad *target = gst_element_get_static_pad (element, name);
  GstPadTemplate *pad_template = gst_static_pad_template_get (ghost);
  GstPad *pad = gst_ghost_pad_new_from_template (name, target, pad_template);
  gst_element_add_pad (GST_ELEMENT (self), pad);
  gst_object_unref (pad_template);
  gst_object_unref (target);
  return pad;
}

} // namespace

static GstStateChangeReturn
gst_range_render_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_RANGE_RENDER (element);
  if (transition == GST_STATE_CHANGE_NULL_TO_READY && self->missing) {
    GST_ELEMENT_ERROR (self, CORE, MISSING_PLUGIN, ("There is no element %s", self->missing),
        ("expected it in the plugins of GStreamer and gst-rangecast"));
    return GST_STATE_CHANGE_FAILURE;
  }
  return GST_ELEMENT_CLASS (gst_range_render_parent_class)->change_state (element, transition);
}

static void
gst_range_render_init (GstRangeRender *self)
{
  GstElement *cylinder = add (self, "cylinderfilter", "cylinder");
  GstElement *render = add (self, "striprender", "render");
  GstElement *download = add (self, "gldownload", "download");
  if (self->missing)
    return;
  g_object_set (render, "fit", TRUE, "background-shade", 0.5, nullptr); /* for viewers */
  gst_element_link_many (cylinder, render, download, nullptr);
  GstPad *sink = add_ghost_pad (self, cylinder, "sink", &sink_template);
  GST_PAD_SET_ACCEPT_INTERSECT (sink); /* cylinderfilter refuses caps that lack a field */
  GstPad *src = add_ghost_pad (self, download, "src", &src_template);
  GstProxyPad *inner = gst_proxy_pad_get_internal (GST_PROXY_PAD (src));
  gst_pad_set_query_function (GST_PAD (inner), GST_DEBUG_FUNCPTR (query_downstream));
  gst_object_unref (inner);
}

static void
gst_range_render_class_init (GstRangeRenderClass *klass)
{
  auto element_class = GST_ELEMENT_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_range_render_debug, "rangerender", 0, "Range image renderer");

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  /* Of what converts something to raw video, decodebin tries only decoders. */
  gst_element_class_set_static_metadata (element_class, "Range image renderer",
      "Codec/Decoder/Video", "Renders range images as raw video, for playbin and decodebin",
      "gst-rangecast");
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_range_render_change_state);
}
