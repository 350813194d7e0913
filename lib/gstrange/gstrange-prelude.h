/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#ifdef BUILDING_GST_RANGE
#define GST_RANGE_API __attribute__ ((visibility ("default")))
#else
#define GST_RANGE_API
#endif
