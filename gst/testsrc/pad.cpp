/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pad.hpp"

#include <gst/video/gstvideopool.h>

#include <gstrange/gstrangebufferpool.h>

namespace {

/* Raw video goes into any pool of the peer, range images only into pools that know their layout. */
GstBufferPool *
pool_of_peer (GstQuery *query, bool range)
{
  GstBufferPool *pool = nullptr;
  if (gst_query_get_n_allocation_pools (query) > 0)
    gst_query_parse_nth_allocation_pool (query, 0, &pool, nullptr, nullptr, nullptr);
  if (pool && range && !GST_IS_RANGE_BUFFER_POOL (pool))
    gst_clear_object (&pool);
  return pool;
}

} // namespace

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

bool
AvatarPad::configure (GstBufferPool *pool, GstQuery *query, GstCaps *caps, guint size)
{
  guint min_size = 0, min = 0, max = 0;
  GstAllocator *allocator = nullptr;
  GstAllocationParams params;
  gst_allocation_params_init (&params);
  if (gst_query_get_n_allocation_pools (query) > 0)
    gst_query_parse_nth_allocation_pool (query, 0, nullptr, &min_size, &min, &max);
  if (gst_query_get_n_allocation_params (query) > 0)
    gst_query_parse_nth_allocation_param (query, 0, &allocator, &params);
  size = MAX (size, min_size);
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, size, min, max);
  gst_buffer_pool_config_set_allocator (config, allocator, &params);
  if (gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  gst_clear_object (&allocator);
  if (gst_buffer_pool_set_config (pool, config))
    return true;
  /* the pool has replaced what it cannot do; accept it if size and counts suffice */
  config = gst_buffer_pool_get_config (pool);
  if (gst_buffer_pool_config_validate_params (config, caps, size, min, max))
    return gst_buffer_pool_set_config (pool, config);
  gst_structure_free (config);
  return false;
}

GstBufferPool *
AvatarPad::make_pool (GstCaps *caps, GstQuery *query)
{
  const bool range = kind_ == AvatarPadKind::kRange;
  const guint size = range ? 0 : static_cast<guint> (GST_VIDEO_INFO_SIZE (&video_));
  GstBufferPool *pool = pool_of_peer (query, range);
  if (pool && configure (pool, query, caps, size) && gst_buffer_pool_set_active (pool, TRUE))
    return pool;
  gst_clear_object (&pool);
  pool = range ? gst_range_buffer_pool_new () : gst_video_buffer_pool_new ();
  if (configure (pool, query, caps, size) && gst_buffer_pool_set_active (pool, TRUE))
    return pool;
  gst_object_unref (pool);
  return nullptr;
}

void
AvatarPad::set_pool (GstBufferPool *pool)
{
  GstBufferPool *old;
  {
    std::lock_guard guard (lock_);
    old = pool_;
    pool_ = pool;
    if (pool && flushing_)
      gst_buffer_pool_set_flushing (pool, TRUE);
  }
  if (old && old != pool)
    gst_buffer_pool_set_active (old, FALSE);
  gst_clear_object (&old);
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
  if (!needs_start_)
    return;
  needs_start_ = false;
  gchar *id = gst_pad_create_stream_id (pad_, element, GST_PAD_NAME (pad_));
  GstEvent *event = gst_event_new_stream_start (id);
  gst_event_set_group_id (event, group_id);
  gst_pad_push_event (pad_, event);
  g_free (id);
}

void
AvatarPad::push_segment (const GstSegment &segment, guint32 seqnum)
{
  if (!needs_segment_)
    return;
  needs_segment_ = false;
  GstEvent *event = gst_event_new_segment (&segment);
  gst_event_set_seqnum (event, seqnum);
  gst_pad_push_event (pad_, event);
}

void
AvatarPad::push_end (GstEvent *event)
{
  if (ended_ || !gst_pad_is_linked (pad_)) { /* a pad that is linked later gets it then */
    gst_event_unref (event);
    return;
  }
  ended_ = true;
  gst_pad_push_event (pad_, event);
}

/* ---- state ---- */

void
AvatarPad::restart ()
{
  needs_segment_ = discont_ = true;
  peer_ended_ = ended_ = false;
}

void
AvatarPad::stop ()
{
  set_pool (nullptr);
  restart ();
  needs_start_ = true;
  negotiated_ = false;
  set_flushing (false);
}

void
AvatarPad::set_flushing (bool flushing)
{
  std::lock_guard guard (lock_);
  flushing_ = flushing;
  if (pool_)
    gst_buffer_pool_set_flushing (pool_, flushing);
}
