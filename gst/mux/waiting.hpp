/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "streams.hpp"

/* A pad with the buffer that waits on it. */
struct Waiting {
  MuxPad *entry;
  GstBuffer *buffer; /* a reference of ours */
  GstClockTime capture, running;
};

/* All buffers that wait, from take() to release(). Keeps its memory from one frame set to the next.
 */
class WaitingBuffers {
public:
  WaitingBuffers () = default;
  ~WaitingBuffers () { release (); }
  WaitingBuffers (const WaitingBuffers &) = delete;

  void take (const MuxPads &pads, bool live);
  void release ();

  /* A gap says that its pad has nothing for a while: nobody waits for that pad until another one's
   * frame is behind the gap. @return whether one went */
  bool drop_past_gaps (bool live, GstClockTime tolerance, bool timeout) const;

  std::vector<Waiting> list, gaps;
  int missing = 0, ended = 0;
};

/* How much faster than it was captured it is played; not 0. */
double speed_of (const Waiting &w);
