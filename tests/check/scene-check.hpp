/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What tests with a moving scene share: frame sets of avatartestsrc, and pixels to compare. */
#pragma once

#include <map>

#include "coded-check.hpp"

namespace rangecast::testing {

/** Frame sets of a person who moves (raw), and what else a harness has to know. */
struct Scene {
  GstCaps *caps = nullptr;
  std::vector<GstBuffer *> frame_sets;

  /** @param views  on a ring
   *  @param properties  of avatartestsrc, more than the size */
  Scene (int views, int width, int height, int count, const char *properties = "")
  {
    const std::string launch =
        "avatartestsrc range-person-only=true num-buffers=" + std::to_string (count) +
        " views=" + std::to_string (views) + " " + properties +
        " ! capsfilter caps=video/x-range,framerate=15/1,width=" + std::to_string (width) +
        ",height=" + std::to_string (height);
    GstHarness *h = gst_harness_new_parse (launch.c_str ());
    gst_harness_play (h);
    for (int i = 0; i < count; i++) {
      GstBuffer *frame_set = nullptr; /* under valgrind it takes longer than a harness waits */
      for (int tries = 0; !frame_set && tries < 10; tries++)
        frame_set = gst_harness_pull (h);
      fail_unless (frame_set != nullptr);
      frame_sets.push_back (frame_set);
    }
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
  }
  ~Scene ()
  {
    unref_all (frame_sets);
    gst_caps_unref (caps);
  }
  Scene (const Scene &) = delete;
  Scene &operator= (const Scene &) = delete;

  static constexpr GstClockTime kInterval = GST_SECOND / 15;
};

/** Depth and colour of each pixel of the views' whole images; 0: invalid. By view-id. */
using Pixels = std::map<int, std::vector<guint64>>;

inline Pixels
pixels_of (GstBuffer *frame_set, int width, int height)
{
  Pixels pixels;
  gstrange::RangeFrameMap frame (frame_set, GST_MAP_READ);
  fail_unless_ok (frame.status ());
  for (const RangeImage &image : frame.views ()) {
    auto &plane = pixels[image.view_id];
    plane.assign (std::size_t (width) * std::size_t (height), 0);
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++) {
        const auto colour = image.colour.at (x, y);
        if (const guint64 depth = image.depth.at (x, y))
          plane[std::size_t ((image.roi.y + y) * width + image.roi.x + x)] =
              depth << 24 | guint64{colour.r} << 16 | guint64{colour.g} << 8 | colour.b;
      }
  }
  return pixels;
}

/** A frame set beside the same one without losses. */
struct Compared {
  guint64 valid = 0; ///< without losses
  guint64 right = 0; ///< of these, the same
  guint64 wrong = 0; ///< there, but another than without losses

  [[nodiscard]] double right_share () const { return double (right) / double (valid); }
};

inline Compared
compare (const Pixels &whole, const Pixels &lossy)
{
  Compared c;
  for (const auto &[id, plane] : whole) {
    const auto other = lossy.find (id);
    for (std::size_t i = 0; i < plane.size (); i++) {
      const guint64 is = other == lossy.end () ? 0 : other->second[i];
      c.valid += plane[i] != 0;
      c.right += plane[i] != 0 && plane[i] == is;
      c.wrong += is != 0 && plane[i] != is;
    }
  }
  for (const auto &[id, plane] : lossy)
    fail_unless (whole.contains (id), "view %d is none of the frame set", id);
  return c;
}

} // namespace rangecast::testing
