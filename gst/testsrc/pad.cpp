/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pad.hpp"

#include <gst/video/gstvideopool.h>

#include <gstrange/gstrangebufferpool.h>
#include <utility>

AvatarPad::AvatarPad (GstPad *pad, AvatarPadKind kind)
    : pad_ (GST_PAD (gst_object_ref (pad))), kind_ (kind)
{
}

AvatarPad::~AvatarPad ()
{
  set_pool (nullptr);
  gst_object_unref (pad_);
}

/* ---- negotiation ---- */

bool
AvatarPad::needs_negotiation ()
{
  if (gst_pad_check_reconfigure (pad_))
    negotiated_ = false;
  return needs_start_ || (!negotiated_ && gst_pad_is_linked (pad_));
}

GstCaps *
AvatarPad::peer_caps () const
{
  GstCaps *own = gst_pad_get_pad_template_caps (pad_);
  GstCaps *peer = gst_pad_peer_query_caps (pad_, own);
  gst_caps_unref (own);
  return peer;
}

/* The peer's allocator; a pool of its own, since a peer's may have fewer buffers than are held. */
GstBufferPool *
AvatarPad::make_pool (GstCaps *caps, GstQuery *query)
{
  const bool range = kind_ == AvatarPadKind::kRange;
  GstBufferPool *pool = range ? gst_range_buffer_pool_new () : gst_video_buffer_pool_new ();
  GstAllocator *allocator = nullptr;
  GstAllocationParams params;
  gst_allocation_params_init (&params);
  if (gst_query_get_n_allocation_params (query) > 0)
    gst_query_parse_nth_allocation_param (query, 0, &allocator, &params);
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (
      config, caps, range ? 0 : static_cast<guint> (GST_VIDEO_INFO_SIZE (&video_)), 0, 0);
  gst_buffer_pool_config_set_allocator (config, allocator, &params);
  if (gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  gst_clear_object (&allocator);
  if (gst_buffer_pool_set_config (pool, config) && gst_buffer_pool_set_active (pool, TRUE))
    return pool;
  gst_object_unref (pool);
  return nullptr;
}

void
AvatarPad::set_pool (GstBufferPool *pool)
{
  if (pool_)
    gst_buffer_pool_set_active (pool_, FALSE);
  gst_clear_object (&pool_);
  pool_ = pool;
}

bool
AvatarPad::negotiate (GstCaps *caps)
{
  GstCaps *old = gst_pad_get_current_caps (pad_);
  const bool same = old && gst_caps_is_equal (old, caps);
  gst_clear_caps (&old);
  if (same && negotiated_)
    return true; /* another pad needed it */
  negotiated_ = peer_ended_ = false;
  if (gst_caps_is_empty (caps))
    return false;
  if (!same && !gst_pad_push_event (pad_, gst_event_new_caps (caps)))
    return false;
  if (kind_ != AvatarPadKind::kRange && !gst_video_info_from_caps (&video_, caps))
    return false;
  set_pool (nullptr); /* the peer may offer the same one again */
  GstQuery *query = gst_query_new_allocation (caps, TRUE);
  gst_pad_peer_query (pad_, query);
  set_pool (make_pool (caps, query));
  gst_query_unref (query);
  negotiated_ = pool_ != nullptr;
  return negotiated_;
}

namespace {

GstCaps *
sizes_of (GstCaps *caps)
{
  GstCaps *sizes = gst_caps_new_empty ();
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    const GstStructure *from = gst_caps_get_structure (caps, i);
    GstStructure *to = gst_structure_new_empty ("size");
    for (const char *field : {"width", "height", "framerate"})
      if (const GValue *value = gst_structure_get_value (from, field))
        gst_structure_set_value (to, field, value);
    gst_caps_append_structure (sizes, to);
  }
  return sizes;
}

GstCaps *
common_sizes (const AvatarPads &pads)
{
  GstCaps *common = gst_caps_from_string ("size, width=(int)[16,4096], height=(int)[16,4096], "
                                          "framerate=(fraction)[1/1000,1000/1]");
  for (const auto &pad : pads) {
    GstCaps *peer = pad->peer_caps (), *sizes = sizes_of (peer);
    GstCaps *both = gst_caps_intersect_full (common, sizes, GST_CAPS_INTERSECT_FIRST);
    gst_caps_unref (peer);
    gst_caps_unref (sizes);
    gst_caps_unref (common);
    common = both;
  }
  return common;
}

} // namespace

bool
avatar_choose_format (const AvatarPads &pads, AvatarFormat &format)
{
  GstCaps *common = common_sizes (pads);
  const bool found = !gst_caps_is_empty (common);
  if (found) {
    common = gst_caps_make_writable (gst_caps_truncate (common));
    GstStructure *size = gst_caps_get_structure (common, 0);
    gst_structure_fixate_field_nearest_int (size, "width", 320);
    gst_structure_fixate_field_nearest_int (size, "height", 240);
    gst_structure_fixate_field_nearest_fraction (size, "framerate", 30, 1);
    gst_structure_get_int (size, "width", &format.width);
    gst_structure_get_int (size, "height", &format.height);
    gst_structure_get_fraction (size, "framerate", &format.fps_n, &format.fps_d);
  }
  gst_caps_unref (common);
  return found;
}

/* ---- data ---- */

GstFlowReturn
AvatarPad::acquire (GstBuffer **buffer)
{
  if (!gst_pad_is_linked (pad_) || !negotiated_)
    return GST_FLOW_NOT_LINKED;
  if (peer_ended_)
    return GST_FLOW_EOS;
  return gst_buffer_pool_acquire_buffer (pool_, buffer, nullptr);
}

GstFlowReturn
AvatarPad::push (GstBuffer *buffer)
{
  if (discont_)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  discont_ = false;
  const GstFlowReturn flow = gst_pad_push (pad_, buffer);
  peer_ended_ = flow == GST_FLOW_EOS;
  return flow;
}

void
AvatarPad::push_stream_start (GstElement *element, guint group_id)
{
  if (!std::exchange (needs_start_, false))
    return;
  gchar *id = gst_pad_create_stream_id (pad_, element, GST_PAD_NAME (pad_));
  GstEvent *event = gst_event_new_stream_start (id);
  gst_event_set_group_id (event, group_id);
  gst_pad_push_event (pad_, event);
  g_free (id);
}

void
AvatarPad::push_segment ()
{
  if (!std::exchange (needs_segment_, false))
    return;
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_pad_push_event (pad_, gst_event_new_segment (&segment));
}

void
AvatarPad::push_eos ()
{
  if (ended_ || !gst_pad_is_linked (pad_)) /* a pad that is linked later gets it then */
    return;
  ended_ = true;
  gst_pad_push_event (pad_, gst_event_new_eos ());
}

/* ---- state ---- */

void
AvatarPad::stop ()
{
  set_pool (nullptr);
  needs_start_ = needs_segment_ = discont_ = true;
  negotiated_ = peer_ended_ = ended_ = false;
}
