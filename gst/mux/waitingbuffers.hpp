/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "streams.hpp"

/** The buffers at the pads of rangemux. Keeps its memory from one frame set to the next. */
class WaitingBuffers {
public:
  WaitingBuffers () = default;
  ~WaitingBuffers () { release (); }
  WaitingBuffers (const WaitingBuffers &) = delete;

  void collect (const MuxStreams &streams, bool live);
  void release ();

  std::vector<WaitingBuffer> list, gaps;
  std::vector<WaitingBuffer> next_round; ///< taken out of `list` by Recordings::compare()
  int missing = 0, ended = 0;            ///< pads without a buffer

private:
  void add_held (MuxStream &stream, GstBuffer *next, bool live);
};
