/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** striprender's debug category: also of its painters where no element uses them, as in benchmarks.
 */
inline GstDebugCategory *
strip_render_category ()
{
  static GstDebugCategory *category = [] {
    GstDebugCategory *created = nullptr;
    GST_DEBUG_CATEGORY_INIT (created, "striprender", 0, "Strip renderer");
    return created;
  }();
  return category;
}

#define GST_CAT_DEFAULT strip_render_category ()
