/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>

/** Posts an error if one of an element's sink pads is still neither linked nor fed by PackedInput,
 *  that is without caps, a second after another one received caps: the element would wait for it
 *  for ever. Any thread. */
class PadLinkWatch {
public:
  PadLinkWatch () = default;
  ~PadLinkWatch () { reset (); }
  PadLinkWatch (const PadLinkWatch &) = delete;
  PadLinkWatch &operator= (const PadLinkWatch &) = delete;

  /** A pad has received caps. Does something at the first call only. */
  void begin (GstElement *element);
  /** In READY. */
  void reset ();

private:
  std::mutex lock_;
  GstClockID timer_ = nullptr; /* kept when it has expired */
};
