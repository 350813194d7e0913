/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

/** Holds the stream lock of the sink pad during stop(). GstBaseTransform has stopped buffers and
 *  events by then, but GStreamer 1.22 still passes serialized queries to flushing pads, and an
 *  ALLOCATION query may call set_caps(). */
class StreamLock {
public:
  explicit StreamLock (GstBaseTransform *base) : pad_ (GST_BASE_TRANSFORM_SINK_PAD (base))
  {
    GST_PAD_STREAM_LOCK (pad_);
  }
  ~StreamLock () { GST_PAD_STREAM_UNLOCK (pad_); }
  StreamLock (const StreamLock &) = delete;
  StreamLock &operator= (const StreamLock &) = delete;

private:
  GstPad *pad_;
};
