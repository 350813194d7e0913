/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>

#include "camera.hpp"

/** A supported pixel format. */
struct PixelFormat {
  ArvPixelFormat code;         ///< GenICam's number
  const char *name;            ///< GenICam's name
  GstVideoFormat video_format; ///< UNKNOWN: Bayer
  const char *bayer;           ///< format of video/x-bayer
  int bytes;                   ///< per pixel
};

/** By GenICam's name ("RGB8Packed" is "RGB8"); null if it is not supported. */
const PixelFormat *find_pixel_format (const std::string &name);
