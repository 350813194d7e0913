/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bufferpools.hpp"

#include <algorithm>
#include <gstrange/gstrangestatus.hpp>
#include <string>

using rangecast::Status;
using rangecast::StatusCode;

void
drop_pool (GstBufferPool *&pool)
{
  if (pool)
    gst_buffer_pool_set_active (pool, FALSE);
  gst_clear_object (&pool);
}

static GstFlowReturn
post_no_memory (GstElement *element, const char *what)
{
  return gst_range_flow_return (
      element, Status (StatusCode::kNoSpace, std::string ("out of memory for ") + what));
}

GstFlowReturn
acquire_buffer (GstElement *element, GstBufferPool *pool, const char *what, GstBuffer **buffer)
{
  const GstFlowReturn flow = gst_buffer_pool_acquire_buffer (pool, buffer, nullptr);
  return flow == GST_FLOW_ERROR ? post_no_memory (element, what) : flow;
}

void
RecycledBytes::drop ()
{
  drop_pool (pool_);
  size_ = 0;
}

GstBuffer *
RecycledBytes::acquire (GstElement *element, gsize size, const char *what)
{
  if (!pool_ || size > size_) {
    drop ();
    if (size > G_MAXUINT) { /* a pool's size is a guint */
      post_no_memory (element, what);
      return nullptr;
    }
    pool_ = gst_buffer_pool_new ();
    size_ = std::min<gsize> (size + size / 2, G_MAXUINT);
    GstStructure *config = gst_buffer_pool_get_config (pool_);
    gst_buffer_pool_config_set_params (config, nullptr, guint (size_), 0, 0);
    if (!gst_buffer_pool_set_config (pool_, config) || !gst_buffer_pool_set_active (pool_, TRUE)) {
      drop ();
      post_no_memory (element, what);
      return nullptr;
    }
  }
  GstBuffer *buffer = nullptr;
  if (acquire_buffer (element, pool_, what, &buffer) != GST_FLOW_OK)
    return nullptr;
  gst_buffer_set_size (buffer, gssize (size));
  return buffer;
}
