/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Gives up a pool, made here or offered by a peer, and clears the pointer; null stays null. */
void drop_pool (GstBufferPool *&pool);

/** A buffer of the pool. Posts an error "no memory left for `what`" where the pool has no memory,
 *  and none where it is flushing. */
GstFlowReturn acquire_buffer (
    GstElement *element, GstBufferPool *pool, const char *what, GstBuffer **buffer);

/** Recycled buffers of plain bytes. Streaming thread. GStreamer's own memory ends the process where
 *  the system refuses it; only what the pool itself refuses is an error here. */
class RecycledBytes {
public:
  RecycledBytes () = default;
  RecycledBytes (const RecycledBytes &) = delete;
  RecycledBytes &operator= (const RecycledBytes &) = delete;
  ~RecycledBytes () { drop (); }

  /** A buffer of `size` bytes; null after an error was posted. The pool grows to the largest size
   *  seen. */
  GstBuffer *acquire (GstElement *element, gsize size, const char *what);
  void drop ();

private:
  GstBufferPool *pool_ = nullptr;
  gsize size_ = 0; /* bytes of each buffer in the pool */
};
