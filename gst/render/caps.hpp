/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Pictures a second; above that a period is too short for times in ns. */
inline constexpr int kMaxFrameRate = 1000;

/** Frame rate of the output's caps. */
struct FrameRate {
  int n = 0, d = 1;       ///< pictures a second; 0/1: none
  bool is_inputs = false; ///< the input's caps have the same
};

/** Output caps for an input: any size, and any frame rate up to kMaxFrameRate, or the
 *  input's if that is higher. Returns: (transfer full) */
GstCaps *strip_output_caps (const GstCaps *input, GstCaps *output_template, GstCaps *filter);

/** Input caps for an output: its frame rate first, so that sources prefer it, then any.
 *  Returns: (transfer full) */
GstCaps *strip_input_caps (const GstCaps *output, GstCaps *input_template, GstCaps *filter);

/** Fixates the output: one picture of 640x480, or that much for each eye, with the input's rate or
 *  near it. @param caps  transfer full. Returns: (transfer full) */
GstCaps *strip_fixate_output (GstCaps *caps, const GstCaps *input);

/** Whether multiview-flags are a string, as gst-launch-1.0 reads them without a type: no element
 *  would interpret it. */
bool strip_has_flags_as_text (const GstCaps *output);

/** The output's frame rate; none if the caps have none. */
FrameRate strip_output_rate (const GstCaps *input, const GstCaps *output);
