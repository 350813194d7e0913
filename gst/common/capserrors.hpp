/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gstrange/gstrangestatus.hpp>
#include <source_location>
#include <string>

/** Posts the error of refused caps once: GStreamer sends them again with each buffer and at the end
 *  of the stream. For the streaming thread; reset when a stream starts. */
class CapsErrors {
public:
  /** Posts the error of a status that is not ok, unless the last call posted the same.
   *  @return whether the status is ok */
  bool accept (GstElement *element, const rangecast::Status &status,
      std::source_location caller = std::source_location::current ())
  {
    const bool posted = !status.ok () && status.message () == last_;
    last_ = status.message ();
    return !posted && gst_range_flow_return (element, status, caller) == GST_FLOW_OK;
  }
  void reset () { last_.clear (); }

private:
  std::string last_;
};
