/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** The debug category of stereocamsrc, for all files of its plugin. Made at its first use, because
 *  the tests use the parts without the element. */
inline GstDebugCategory *
camera_debug_category ()
{
  static GstDebugCategory *const category = [] {
    GstDebugCategory *made = nullptr;
    GST_DEBUG_CATEGORY_INIT (made, "stereocamsrc", 0, "Stereo camera source");
    return made;
  }();
  return category;
}
#define GST_CAT_DEFAULT camera_debug_category ()
