/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>

#include "common/recycledmemories.hpp"

/** Assembles the units of an access unit, as they arrive, within the limits of one. The memory goes
 *  out as a buffer without being copied, and is used again once downstream is done with it.
 *  Streaming thread. */
class AccessUnitAssembler {
public:
  AccessUnitAssembler () = default;
  ~AccessUnitAssembler () { reset (); }
  AccessUnitAssembler (const AccessUnitAssembler &) = delete;
  AccessUnitAssembler &operator= (const AccessUnitAssembler &) = delete;

  [[nodiscard]] bool empty () const { return size_ == 0; }

  /** Appends a unit.
   *  @return false, and the unit is lost, if the access unit would become longer than
   *  kMaxAccessUnitSize or have more than kMaxSlices units, or if memory is short */
  bool add (std::span<const guint8> unit);
  /** Discards the units. */
  void clear () { size_ = units_ = 0; }
  /** The access unit, which is not empty; empty afterwards. @return transfer full */
  GstBuffer *finish ();
  /** Discards the units and frees all memory. */
  void reset ();

private:
  bool grow (gsize needed);

  RecycledMemories memories_;
  GstMemory *memory_ = nullptr; /* mapped, or nullptr */
  GstMapInfo map_{};
  gsize size_ = 0, units_ = 0; /* bytes and units so far */
  gsize expected_ = 0;         /* size of the next access unit, a guess */
};
