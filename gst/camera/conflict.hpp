/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <string>

/** Why negotiation failed: the first pad whose peer accepts none of the formats, the field in
 *  question, what downstream asks for, and what the cameras and the pads before it leave.
 *  @param offered  of camera_source_caps() */
std::string caps_conflict (GstCaps *offered, std::span<GstPad *const> pads);
