/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/sync/ticks.hpp>

#include "caps.hpp"
#include "pad.hpp"
#include "pairing.hpp"
#include "settings.hpp"

/** The pads as one session sees them: gives image sets their time stamps and sends them. For the
 *  session's thread, or the one that it waits for; send_eos() for any. */
class SetOutput {
public:
  /** @param pads, settings  outlive this */
  SetOutput (GstElement *element, const CameraPads &pads, guint group_id,
      const StereoCamSettings &settings)
      : element_ (element), pads_ (pads), group_id_ (group_id), settings_ (settings)
  {
  }

  void set_format (const SourceFormat &format);
  /** Sends a set, unless it was captured before running time 0, or in time that GAPs covered.
   *  @return false: this was the last of num-buffers */
  bool send (ImageSet &set);
  /** Sends GAP events from the end of the last set, so that downstream goes on without images.
   *  @param until_ago  ns before now where the gap ends */
  void send_gaps (GstClockTime until_ago = 0);
  void send_eos (guint32 seqnum) const;

  /** When the last set was sent, g_get_monotonic_time, ns; 0: none. */
  [[nodiscard]] std::int64_t last_sent_ns () const { return last_sent_ns_; }

private:
  [[nodiscard]] GstClockTime capture_time (const ImageSet &set) const;

  GstElement *element_;
  const CameraPads &pads_;
  const guint group_id_;
  const StereoCamSettings &settings_;
  rangecast::TickRate rate_;
  GstClockTime period_ = 0;
  guint64 sent_ = 0; ///< sets
  std::int64_t last_sent_ns_ = 0;
  /* Running time. */
  GstClockTime last_pts_ = GST_CLOCK_TIME_NONE, covered_until_ = 0, gap_until_ = 0;
};
