/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Deactivates and unrefs a pool, whether created here or offered by a peer, and clears the
 *  pointer, which may be null. */
void drop_pool (GstBufferPool *&pool);

/** Acquires a buffer. Posts the error "out of memory for `what`" if the pool cannot allocate one; a
 *  flushing pool posts nothing. */
GstFlowReturn acquire_buffer (
    GstElement *element, GstBufferPool *pool, const char *what, GstBuffer **buffer);

/** A pool of plain byte buffers that grows to the largest size requested. Not thread-safe.
 *  GStreamer's allocator aborts when the system is out of memory; errors reported here are the
 *  pool's own. */
class RecycledBytes {
public:
  RecycledBytes () = default;
  RecycledBytes (const RecycledBytes &) = delete;
  RecycledBytes &operator= (const RecycledBytes &) = delete;
  ~RecycledBytes () { drop (); }

  /** @return a buffer of `size` bytes (transfer full), or null after posting an error */
  GstBuffer *acquire (GstElement *element, gsize size, const char *what);
  void drop ();

private:
  GstBufferPool *pool_ = nullptr;
  gsize size_ = 0; /* bytes of each buffer in the pool */
};
