/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <vector>

/** Memories that are used again once nobody else refers to them. A GstBufferPool would free each
 *  memory that was appended to another buffer: when a buffer of the pool returns, its parent's copy
 *  of the memory still exists. Streaming thread. */
class RecycledMemories {
public:
  RecycledMemories () = default;
  ~RecycledMemories () { drop (); }
  RecycledMemories (const RecycledMemories &) = delete;
  RecycledMemories &operator= (const RecycledMemories &) = delete;

  /** @return transfer full: a memory of `size` bytes that nobody else refers to, with maxsize half
   *  as much again where it is new; nullptr if memory is short */
  GstMemory *acquire (gsize size);
  /** Gives up all memories; those in use live on. */
  void drop ();

private:
  std::vector<GstMemory *> memories_; /* references; those without another one are free */
};
