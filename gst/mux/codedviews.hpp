/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <rangecast/base/status.hpp>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <vector>

/** Which units of a coded frame set belong to which view. For the streaming thread; keeps its
 *  memory from one frame set to the next. */
class CodedViews {
public:
  /** Reads all headers of a buffer of whole units.
   *  @return kBadData if the buffer cannot be mapped; damaged units are no error, see dropped() */
  rangecast::Status read (GstBuffer *frame_set);

  /** Units of the last frame set that say no view, or whose header is damaged. */
  [[nodiscard]] guint64 dropped () const { return dropped_; }
  /** Whether view `id`, 0 to 63, has slices in it. */
  [[nodiscard]] bool has (int id) const { return !views_[std::size_t (id)].ranges.empty (); }
  /** Of the view's first slice, ns. */
  [[nodiscard]] GstClockTime capture_time (int id) const
  {
    return views_[std::size_t (id)].capture_time;
  }
  /** Whether a decoder can begin at what there is of the view. */
  [[nodiscard]] bool is_key (int id) { return views_[std::size_t (id)].check.is_key (); }
  /** The units of one view. Bytes are shared, unless they lie in more pieces than a buffer can
   * hold.
   *  @param frame_set  what read() had
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
