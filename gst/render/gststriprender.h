/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

G_BEGIN_DECLS

#define GST_TYPE_STRIP_RENDER (gst_strip_render_get_type ())
G_DECLARE_FINAL_TYPE (GstStripRender, gst_strip_render, GST, STRIP_RENDER, GstGLBaseFilter)

GST_ELEMENT_REGISTER_DECLARE (striprender);

G_END_DECLS
