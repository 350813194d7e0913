/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangerender
 * @title: rangerender
 *
 * Renders range images, raw or coded, as raw video: neighbourcodedec where needed, rangealign and
 * striprender in one bin, which playbin, playbin3 and decodebin plug as the decoder. The elements
 * inside are named `decoder`, `align` and `render`; gst-launch-1.0 sets their properties with names
 * such as `render::auto-orbit=30`.
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
#include <gst/gst.h>

#include <gstrange/gstrangecaps.h>

#include "opengl.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_range_render_debug);
#define GST_CAT_DEFAULT gst_range_render_debug

G_DECLARE_FINAL_TYPE (GstRangeRender, gst_range_render, GST, RANGE_RENDER, GstBin)

struct _GstRangeRender {
  GstBin parent;
  const char *missing; /* factory of an element that could not be created */
  GstPad *sink;
  GstElement *align, *decoder; /* owned by the bin; decoder: nullptr if the input is raw */
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE ("sink", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS "; " GST_NEIGHBOUR_CODE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (STRIP_CAPS));

G_DEFINE_TYPE (GstRangeRender, gst_range_render, GST_TYPE_BIN)
/* Above neighbourcodedec: decodebin3 plugs a single decoder, and video sinks want pictures. */
GST_ELEMENT_REGISTER_DEFINE (
    rangerender, "rangerender", GST_RANK_PRIMARY + 1, gst_range_render_get_type ())

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

void
report_missing (GstRangeRender *self, const char *factory)
{
  GST_ELEMENT_ERROR (self, CORE, MISSING_PLUGIN, ("There is no element %s", factory),
      ("expected it in the plugins of GStreamer and gst-rangecast"));
}

void
set_target (GstRangeRender *self, GstElement *element)
{
  GstPad *target = gst_element_get_static_pad (element, "sink");
  gst_ghost_pad_set_target (GST_GHOST_PAD (self->sink), target);
  gst_object_unref (target);
}

/* Puts a decoder before rangealign, or removes it. In the streaming thread. */
bool
use_decoder (GstRangeRender *self, bool coded)
{
  if (coded == (self->decoder != nullptr))
    return true;
  gst_ghost_pad_set_target (GST_GHOST_PAD (self->sink), nullptr);
  if (!coded) {
    gst_element_set_state (self->decoder, GST_STATE_NULL);
    gst_bin_remove (GST_BIN (self), self->decoder);
    self->decoder = nullptr;
    set_target (self, self->align);
    return true;
  }
  GstElement *decoder = gst_element_factory_make ("neighbourcodedec", "decoder");
  if (!decoder) {
    report_missing (self, "neighbourcodedec");
    return false;
  }
  self->decoder = decoder;
  gst_bin_add (GST_BIN (self), decoder);
  gst_element_link (decoder, self->align);
  gst_element_sync_state_with_parent (decoder);
  set_target (self, decoder);
  return true;
}

gboolean
handle_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    GST_INFO_OBJECT (pad, "caps %" GST_PTR_FORMAT, caps);
    const bool coded =
        gst_structure_has_name (gst_caps_get_structure (caps, 0), GST_NEIGHBOUR_CODE_MEDIA_TYPE);
    if (!use_decoder (GST_RANGE_RENDER (parent), coded)) {
      gst_event_unref (event);
      return FALSE;
    }
  }
  return gst_pad_event_default (pad, parent, event);
}

/* Answers for both kinds of input, of which the target knows one. */
gboolean
answer_sink_query (GstPad *pad, GstObject *parent, GstQuery *query)
{
  switch (GST_QUERY_TYPE (query)) {
    case GST_QUERY_CAPS: {
      GstCaps *filter = nullptr, *caps = gst_pad_get_pad_template_caps (pad);
      gst_query_parse_caps (query, &filter);
      if (filter) {
        GstCaps *wanted = gst_caps_intersect_full (filter, caps, GST_CAPS_INTERSECT_FIRST);
        gst_caps_unref (caps);
        caps = wanted;
      }
      gst_query_set_caps_result (query, caps);
      gst_caps_unref (caps);
      return TRUE;
    }
    case GST_QUERY_ACCEPT_CAPS: {
      GstCaps *caps, *accepted = gst_pad_get_pad_template_caps (pad);
      gst_query_parse_accept_caps (query, &caps);
      gst_query_set_accept_caps_result (query, gst_caps_can_intersect (caps, accepted));
      gst_caps_unref (accepted);
      return TRUE;
    }
    default:
      return gst_pad_query_default (pad, parent, query);
  }
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
    report_missing (self, self->missing);
    return GST_STATE_CHANGE_FAILURE;
  }
  return GST_ELEMENT_CLASS (gst_range_render_parent_class)->change_state (element, transition);
}

static void
gst_range_render_init (GstRangeRender *self)
{
  GstElement *align = add (self, "rangealign", "align");
  GstElement *render = add (self, "striprender", "render");
  if (self->missing)
    return;
  g_object_set (render, "fit", TRUE, "background-shade", 0.5, nullptr); /* for viewers */
  gst_element_link (align, render);
  self->align = align;
  self->sink = add_ghost_pad (self, align, "sink", &sink_template);
  gst_pad_set_event_function (self->sink, GST_DEBUG_FUNCPTR (handle_sink_event));
  gst_pad_set_query_function (self->sink, GST_DEBUG_FUNCPTR (answer_sink_query));
  add_ghost_pad (self, render, "src", &src_template);
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
      "Codec/Decoder/Video",
      "Renders raw or coded range images as raw video, for playbin and decodebin", "gst-rangecast");
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_range_render_change_state);
}
