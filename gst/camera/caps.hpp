/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/camera.hpp"
#include <span>
#include <string>

/** The format of all cameras of stereocamsrc. */
struct SourceFormat {
  std::string pixel_format; ///< GenICam's name
  int width = 0, height = 0;
  int fps_n = 1, fps_d = 1;
  GstCaps *caps = nullptr; ///< fixed; owned

  SourceFormat () = default;
  ~SourceFormat () { gst_clear_caps (&caps); }
  SourceFormat (const SourceFormat &) = delete;
  SourceFormat &operator= (const SourceFormat &) = delete;

  /** Frame period, ns. */
  [[nodiscard]] GstClockTime period () const
  {
    return gst_util_uint64_scale_int (GST_SECOND, fps_d, fps_n);
  }
};

/** What all cameras can provide. Widths are multiples of 4, so that elements without GstVideoMeta
 *  find the rows.
 *  @param pixel_format  only this one; empty: any
 *  @param[out] why      if the result is empty: what the cameras lack in common
 *  @return transfer full */
GstCaps *camera_source_caps (std::span<const CameraAbilities> cameras,
    std::span<const std::string> labels, const std::string &pixel_format, std::string &why);

/** The format that the peers of all pads accept: the largest images, the rate nearest to 30 per
 *  second. Pads without a peer accept all.
 *  @param offered   of camera_source_caps(); transfer none
 *  @param[out] why  if there is none: the pad, what its peer accepts, and what is left to choose */
void choose_camera_format (GstCaps *offered, std::span<GstPad *const> pads,
    std::span<const CameraAbilities> cameras, SourceFormat &format, std::string &why);
