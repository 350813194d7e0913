/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define GST_TYPE_AVATAR_TEST_SRC (gst_avatar_test_src_get_type ())
G_DECLARE_FINAL_TYPE (GstAvatarTestSrc, gst_avatar_test_src, GST, AVATAR_TEST_SRC, GstElement)

GST_ELEMENT_REGISTER_DECLARE (avatartestsrc);

G_END_DECLS
