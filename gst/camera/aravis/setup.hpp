/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "camera.hpp"
#include "control.hpp"

/** The steps of Camera::configure(), in the order that cameras need. All may wait for the camera.
 */
CameraStatus read_abilities (CameraControl &control, CameraAbilities &abilities);
/** Pixel format, region. */
CameraStatus set_image (CameraControl &control, const CameraSettings &settings);
/** The format that the camera is set to, without the frame rate. */
CameraStatus read_format (CameraControl &control, CameraFormat &format);
CameraStatus set_trigger (CameraControl &control, const CameraSettings &settings);
/** Exposure, gain, white balance, frame rate; `frame_rate` is what the camera then reports. */
CameraStatus set_imaging (
    CameraControl &control, const CameraSettings &settings, double &frame_rate);
CameraStatus set_transport (CameraControl &control, const CameraSettings &settings);
CameraStatus set_features (CameraControl &control, const std::string &features);

/* Not at the same time: selectors are state. */
CameraStatus read_imaging (CameraControl &control, ImagingParameters &parameters);
/** Sets the values that differ from `written` by more than a thousandth, and records them there. */
CameraStatus write_imaging (
    CameraControl &control, const ImagingParameters &parameters, ImagingParameters &written);
