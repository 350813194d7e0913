/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-avatartestsrc
 * @title: avatartestsrc
 *
 * Renders a moving head and shoulders in a textured room, as seen by a rig of stereo cameras. The
 * figure is built in, or a glTF model
 * (#GstAvatarTestSrc:location, #GstAvatarTestSrc:model-top).
 *
 * Request pads `left`, `right` and `third` output the cameras of one view, `src` outputs exact
 * range images. One thread feeds all pads: put a queue behind each where there are several. Pads
 * may be requested and released in any state.
 *
 * The same properties, size and time give the same images in every process. Live, frames are at
 * multiples of the frame period on the pipeline clock.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 avatartestsrc ! rangesplit name=s s.depth ! videoconvert ! autovideosink
 * ]|
 * |[
 * gst-launch-1.0 avatartestsrc location=head.glb name=s s.left ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include <gst/video/video.h>

#include <gstrange/gstrange.h>
#include <mutex>

#include "common/elementproperties.hpp"
#include "settings.hpp"
#include "stream.hpp"

GST_DEBUG_CATEGORY (gst_avatar_test_src_debug); /* for stream.cpp, too */

struct GstAvatarTestSrcPrivate {
  std::mutex lock; /* guards settings; taken before those of the stream */
  AvatarSettings settings;
  AvatarStream stream;

  explicit GstAvatarTestSrcPrivate (GstElement *element) : stream (element) {}
};

DECLARE_ELEMENT (GstAvatarTestSrc, gst_avatar_test_src, AVATAR_TEST_SRC, GstElement)

#define SIZE_CAPS                                                                                  \
  "width = (int) [ 16, 4096 ], height = (int) [ 16, 4096 ], "                                      \
  "framerate = (fraction) [ 1/1000, 1000/1 ]"
#define RAW_CAPS "video/x-raw, format = (string) RGBx, " SIZE_CAPS
#define AVATAR_RANGE_CAPS                                                                          \
  GST_RANGE_MEDIA_TYPE ", format = (string) Z16_RGBx, views = (int) [ 1, 64 ], " SIZE_CAPS

static GstStaticPadTemplate left_template =
    GST_STATIC_PAD_TEMPLATE ("left", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate right_template =
    GST_STATIC_PAD_TEMPLATE ("right", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate third_template =
    GST_STATIC_PAD_TEMPLATE ("third", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (AVATAR_RANGE_CAPS));

G_DEFINE_TYPE (GstAvatarTestSrc, gst_avatar_test_src, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (
    avatartestsrc, "avatartestsrc", GST_RANK_NONE, gst_avatar_test_src_get_type ())

/* ---- queries and events ---- */

static gboolean
gst_avatar_test_src_query (GstPad *pad, GstObject *parent, GstQuery *query)
{
  if (GST_QUERY_TYPE (query) != GST_QUERY_LATENCY)
    return gst_pad_query_default (pad, parent, query);
  /* a frame is sent when it is captured, and lasts one period */
  AvatarStream &stream = GST_AVATAR_TEST_SRC (parent)->priv->stream;
  const bool live = stream.is_live ();
  gst_query_set_latency (query, live, live ? stream.period () : 0, GST_CLOCK_TIME_NONE);
  return TRUE;
}

static gboolean
gst_avatar_test_src_event (GstPad *, GstObject *parent, GstEvent *event)
{
  bool handled = false;
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_RECONFIGURE: /* GstPad has marked the pad; the task may be paused */
      GST_AVATAR_TEST_SRC (parent)->priv->stream.pad_linked ();
      handled = true;
      break;
    case GST_EVENT_QOS: /* frames are neither dropped nor delayed on request */
    case GST_EVENT_LATENCY:
      handled = true;
      break;
    default:
      break;
  }
  gst_event_unref (event);
  return handled;
}

static gboolean
gst_avatar_test_src_send_event (GstElement *element, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) != GST_EVENT_EOS)
    return GST_ELEMENT_CLASS (gst_avatar_test_src_parent_class)->send_event (element, event);
  gst_event_unref (event);
  return GST_AVATAR_TEST_SRC (element)->priv->stream.end ();
}

/* ---- request pads ---- */

static GstPad *
gst_avatar_test_src_request_new_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *, const GstCaps *)
{
  const gchar *name = GST_PAD_TEMPLATE_NAME_TEMPLATE (pad_template);
  GstPad *pad = gst_pad_new_from_template (pad_template, name);
  gst_pad_set_query_function (pad, GST_DEBUG_FUNCPTR (gst_avatar_test_src_query));
  gst_pad_set_event_function (pad, GST_DEBUG_FUNCPTR (gst_avatar_test_src_event));
  if (!gst_element_add_pad (element, pad)) /* warns that the name is taken */
    return nullptr;
  const AvatarPadKind kind = g_str_equal (name, "left")    ? AvatarPadKind::kLeft
                             : g_str_equal (name, "right") ? AvatarPadKind::kRight
                             : g_str_equal (name, "third") ? AvatarPadKind::kThird
                                                           : AvatarPadKind::kRange;
  GST_AVATAR_TEST_SRC (element)->priv->stream.add_pad (pad, kind);
  return pad;
}

static void
gst_avatar_test_src_release_pad (GstElement *element, GstPad *pad)
{
  GST_AVATAR_TEST_SRC (element)->priv->stream.remove_pad (pad);
  gst_pad_set_active (pad, FALSE);
  gst_element_remove_pad (element, pad);
}

/* ---- state changes ---- */

static GstStateChangeReturn
gst_avatar_test_src_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_AVATAR_TEST_SRC (element);
  AvatarStream &stream = self->priv->stream;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !stream.start (settings_of (self->priv)))
    return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED)
    stream.set_playing (false);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    stream.request_stop ();
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_avatar_test_src_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    stream.stop ();
  if (result == GST_STATE_CHANGE_FAILURE)
    return result;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED)
    stream.run ();
  if (transition == GST_STATE_CHANGE_PAUSED_TO_PLAYING)
    stream.set_playing (true);
  const bool to_paused = transition == GST_STATE_CHANGE_READY_TO_PAUSED ||
                         transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED;
  return to_paused && stream.is_live () ? GST_STATE_CHANGE_NO_PREROLL : result;
}

static GstStructure *
make_stats (GstAvatarTestSrcPrivate *priv)
{
  return gst_structure_new ("application/x-avatartestsrc-stats", "frames", G_TYPE_UINT64,
      priv->stream.frames (), "skipped", G_TYPE_UINT64, priv->stream.skipped (), nullptr);
}

static void
gst_avatar_test_src_init (GstAvatarTestSrc *self)
{
  self->priv = new GstAvatarTestSrcPrivate (GST_ELEMENT (self));
  GST_OBJECT_FLAG_SET (self, GST_ELEMENT_FLAG_SOURCE);
}

static void
gst_avatar_test_src_class_init (GstAvatarTestSrcClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  object_class->finalize = delete_private<GstAvatarTestSrc>;
  install_properties<GstAvatarTestSrc, avatar_properties, make_stats> (
      object_class, "Counters since the element was started");

  for (GstStaticPadTemplate *pad_template :
      {&src_template, &left_template, &right_template, &third_template})
    gst_element_class_add_static_pad_template (element_class, pad_template);
  gst_element_class_set_static_metadata (element_class, "Avatar test source", "Source/Video",
      "Renders a moving head and shoulders as seen by a rig of stereo cameras, with exact depth",
      "gst-rangecast");

  element_class->request_new_pad = GST_DEBUG_FUNCPTR (gst_avatar_test_src_request_new_pad);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_avatar_test_src_release_pad);
  element_class->send_event = GST_DEBUG_FUNCPTR (gst_avatar_test_src_send_event);
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_avatar_test_src_change_state);

  GST_DEBUG_CATEGORY_INIT (gst_avatar_test_src_debug, "avatartestsrc", 0, "Avatar test source");
}
