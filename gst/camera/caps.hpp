/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/camera.hpp"
#include <span>
#include <string>
#include <vector>

/** What all cameras of stereocamsrc take their pictures as. */
struct SourceFormat {
  std::string pixel_format; ///< GenICam's name
  int width = 0, height = 0;
  int fps_n = 0, fps_d = 1; ///< 0/1: single pictures
  GstCaps *caps = nullptr;  ///< fixed; owned

  SourceFormat () = default;
  ~SourceFormat () { gst_clear_caps (&caps); }
  SourceFormat (const SourceFormat &) = delete;
  SourceFormat &operator= (const SourceFormat &) = delete;

  /** ns; 0: there is none */
  [[nodiscard]] GstClockTime period () const
  {
    return fps_n > 0 ? gst_util_uint64_scale_int (GST_SECOND, fps_d, fps_n) : 0;
  }
};

/** What all of the cameras can do, as caps: rows of whole words (widths are multiples of 4), so
 * that no element needs GstVideoMeta to find them.
 *  @param pixel_format  only this one; empty: any
 *  @param single_shot   the frame rate may be 0/1
 *  @param[out] why      if the result is empty: what they lack in common
 *  @return transfer full */
GstCaps *camera_source_caps (std::span<const CameraAbilities> cameras,
    std::span<const std::string> labels, const std::string &pixel_format, bool single_shot,
    std::string &why);

/** The format that the peers of all pads take: the largest pictures, the rate nearest to 30 a
 *  second. Pads without a peer take all.
 *  @param offered  of camera_source_caps(); transfer none
 *  @return false if there is none */
bool choose_camera_format (GstCaps *offered, std::span<GstPad *const> pads,
    std::span<const CameraAbilities> cameras, SourceFormat &format);
