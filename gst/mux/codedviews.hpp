/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <vector>

/** Finds the units of each view in a coded frame set. Streaming thread; keeps its memory from one
 *  frame set to the next. */
class CodedViews {
public:
  /** Reads the headers of all units.
   *  @return kBadData if the buffer cannot be mapped; damaged units are counted, see dropped() */
  rangecast::Status read (GstBuffer *frame_set);

  /** Units of the frame set without a view, or with a damaged header. */
  [[nodiscard]] guint64 dropped () const { return dropped_; }
  /** Whether view `id`, 0 to 63, has slices in the frame set. */
  [[nodiscard]] bool has (int id) const { return !views_[std::size_t (id)].ranges.empty (); }
  /** Of the view's first slice, ns. */
  [[nodiscard]] GstClockTime capture_time (int id) const
  {
    return views_[std::size_t (id)].capture_time;
  }
  /** Whether a decoder can begin with the view's slices. */
  [[nodiscard]] bool is_key (int id) { return views_[std::size_t (id)].check.is_key (); }
  /** The units of one view. Memory is shared, unless the units are in more pieces than a buffer has
   *  memories.
   *  @param frame_set  that of read()
   *  @return transfer full; without times and flags */
  [[nodiscard]] GstBuffer *copy_view (GstBuffer *frame_set, int id) const;

private:
  struct Range {
    gsize offset, size; /* bytes of the frame set */
  };
  struct OneView {
    std::vector<Range> ranges;
    GstClockTime capture_time = GST_CLOCK_TIME_NONE;
    rangecast::KeyCheck check;
  };
  bool add_unit (gsize offset, std::span<const guint8> unit);

  std::array<OneView, rangecast::kMaxViews> views_; /* by view-id */
  guint64 dropped_ = 0;
};
