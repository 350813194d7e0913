/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <atomic>
#include <string>

/** How a stereo camera packs its two views into one image. */
enum class Packing { kAuto, kNone, kSideBySide, kTopBottom };

/** Lets one sink pad take images that contain both views of a stereo camera: half of each image,
 * and all events, go on to another sink pad, which is not linked. Images are not copied. */
class PackedInput {
public:
  /** Watches both pads. For instance_init, once; both pads are the element's. */
  void watch (GstElement *element, GstPad *first, GstPad *second);
  /** Before the pads are activated. kAuto: as field multiview-mode of the caps says. */
  void start (Packing packing);
  /** Before the pads are deactivated: the first pad's thread may wait at the second. */
  void stop ();

private:
  GstPadProbeReturn handle (GstPadProbeInfo *info);
  GstPadProbeReturn handle_caps (GstPadProbeInfo *info);
  GstPadProbeReturn handle_buffer (GstPadProbeInfo *info);
  void post (const std::string &what, const std::string &expected);
  GstPadProbeReturn refuse (
      GstPadProbeInfo *info, const std::string &what, const std::string &expected);
  GstBuffer *make_view (GstBuffer *packed, bool first) const;

  GstElement *element_ = nullptr;
  GstPad *first_ = nullptr, *second_ = nullptr;
  Packing packing_ = Packing::kAuto;

  std::atomic<bool> is_packed_ = false; /* written by the streaming thread of the first pad */

  /* that thread only */
  bool is_refused_ = false, saw_one_view_ = false, second_view_first_ = false;
  GstVideoInfo packed_{};           /* of the caps */
  int offset_x_ = 0, offset_y_ = 0; /* of the later view, pixels */
};
