/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <string>

/** Why no format satisfies all: the first pad whose peer cannot be pleased, the field that it is
 *  about, what downstream asks for and what there is, as the cameras and the pads before have it.
 *  @param offered  what all cameras can */
std::string caps_conflict (GstCaps *offered, std::span<GstPad *const> pads);
