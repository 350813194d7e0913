/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

/** The stream lock of the sink pad, for stop(): GstBaseTransform has seen to it that no buffer and
 *  no event comes any more, but GStreamer (1.22) lets serialised queries through to pads that are
 *  flushing, and an ALLOCATION query may bring set_caps(). */
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
