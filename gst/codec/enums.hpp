/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/* What neighbourcodeenc's properties choose from. */
#define GST_TYPE_NEIGHBOUR_CODE_PROFILE (gst_neighbour_code_profile_get_type ())
#define GST_TYPE_NEIGHBOUR_CODE_CHOICE (gst_neighbour_code_choice_get_type ())
#define GST_TYPE_NEIGHBOUR_CODE_DEPTH_SCALE (gst_neighbour_code_depth_scale_get_type ())

GType gst_neighbour_code_profile_get_type (void);
GType gst_neighbour_code_choice_get_type (void);
GType gst_neighbour_code_depth_scale_get_type (void);
