/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "outputschedule.hpp"

/** The output for an input: of any size and any frame rate up to 1000 a second, which the element
 *  makes itself, or the input's. Returns: (transfer full) */
GstCaps *strip_output_caps (const GstCaps *input, GstCaps *output_template, GstCaps *filter);

/** The input for an output: of its frame rate first, so that sources that may choose give that,
 * then of any. Returns: (transfer full) */
GstCaps *strip_input_caps (const GstCaps *output, GstCaps *input_template, GstCaps *filter);

/** Chooses the output where downstream leaves it open: one picture of 640x480, or that much for
 *  each eye. @param caps  transfer full. Returns: (transfer full) */
GstCaps *strip_fixate_output (GstCaps *caps, const GstCaps *input);

/** Whether multiview-flags are what gst-launch-1.0 makes of them without a type: text, which would
 * be passed on and mean nothing. */
bool strip_has_flags_as_text (const GstCaps *output);

/** The output's frame rate; none if the caps have none. */
FrameRate strip_output_rate (const GstCaps *input, const GstCaps *output);
