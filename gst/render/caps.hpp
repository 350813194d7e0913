/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Pictures a second; above that a period is too short for times in ns. */
inline constexpr int kMaxFrameRate = 1000;

/** Output caps: any size, and any frame rate up to kMaxFrameRate. Returns: (transfer full) */
GstCaps *strip_output_caps (GstCaps *output_template, GstCaps *filter);

/** Input caps for an output: its frame rate first, so that sources prefer it, then any.
 *  Returns: (transfer full) */
GstCaps *strip_input_caps (const GstCaps *output, GstCaps *input_template, GstCaps *filter);

/** Fixates the output: one picture of 640x480, or that much for each eye, with the input's rate or
 *  near it. @param caps  transfer full. Returns: (transfer full) */
GstCaps *strip_fixate_output (GstCaps *caps, const GstCaps *input);

/** Whether multiview-flags are a string, as gst-launch-1.0 reads them without a type: no element
 *  would interpret it. */
bool strip_has_flags_as_text (const GstCaps *output);
