/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <vector>

/** The units of an access unit, as they arrive, with the limits of one. Its bytes go on as a buffer
 *  without being copied. For the streaming thread. */
class UnitGatherer {
public:
  [[nodiscard]] bool empty () const { return bytes_.empty (); }
  [[nodiscard]] std::size_t size () const { return bytes_.size (); }

  /** Appends a unit. @return false if the access unit would become longer than kMaxAccessUnitSize
   * or have more than kMaxSlices units: it is lost then */
  bool add (std::span<const guint8> unit)
  {
    if (bytes_.size () + unit.size () > rangecast::kMaxAccessUnitSize ||
        units_ == rangecast::kMaxSlices)
      return false;
    if (bytes_.capacity () == 0)
      bytes_.reserve (expected_);
    bytes_.insert (bytes_.end (), unit.begin (), unit.end ());
    units_++;
    return true;
  }

  void clear ()
  {
    bytes_.clear ();
    units_ = 0;
  }

  /** All of it; empty afterwards. @return transfer full */
  GstBuffer *take ()
  {
    expected_ = std::min (bytes_.size () + bytes_.size () / 8, kMaxExpected);
    auto bytes = new std::vector<guint8> (std::move (bytes_));
    bytes_ = {};
    units_ = 0;
    return gst_buffer_new_wrapped_full (GstMemoryFlags (0), bytes->data (), bytes->size (), 0,
        bytes->size (), bytes,
        [] (gpointer data) { delete static_cast<std::vector<guint8> *> (data); });
  }

private:
  /* A single huge access unit does not claim memory for all that follow it. */
  static constexpr std::size_t kMaxExpected = std::size_t{1} << 20;

  std::vector<guint8> bytes_;
  std::size_t units_ = 0;
  std::size_t expected_ = 0; /* bytes of the next one, a guess */
};
