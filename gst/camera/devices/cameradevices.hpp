/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/types.hpp"
#include "knownrigs.hpp"

/** A device of class Source/Video that aravissrc opens. Its properties: device.api, device.bus,
 *  camera.protocol, .id, .vendor, .model, .serial, .address, and,
 *  if it cannot be opened, camera.problem (why, and what to do).
 *  @return (transfer floating) */
GstDevice *new_camera_device (const CameraInfo &camera);

/** A device of class Source/Video/Stereo that stereocamsrc opens. Its properties: device.api,
 *  rig.file, rig.view-id, camera.left, .right and .third.
 *  @return (transfer floating) */
GstDevice *new_pair_device (const KnownPair &pair);
