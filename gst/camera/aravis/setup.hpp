/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "camera.hpp"
#include "control.hpp"

/** What configure() does, in the order in which cameras need it. All may wait for the camera. */
CameraStatus read_abilities (CameraControl &control, CameraAbilities &abilities);
/** Pixel format, region. */
CameraStatus set_image (CameraControl &control, const CameraSettings &settings);
/** What the camera is set to, without the frame rate. */
CameraStatus read_format (CameraControl &control, CameraFormat &format);
CameraStatus set_trigger (CameraControl &control, const CameraSettings &settings);
/** Exposure, gain, white balance, frame rate; `frame_rate` is what the camera then says. */
CameraStatus set_imaging (
    CameraControl &control, const CameraSettings &settings, double &frame_rate);
CameraStatus set_transport (CameraControl &control, const CameraSettings &settings);
CameraStatus set_features (CameraControl &control, const std::string &features);

/* Selectors are state: one of these at a time. */
CameraStatus read_imaging (CameraControl &control, ImagingParameters &parameters);
/** Sets what differs from `written` by more than a thousandth, and notes it there. */
CameraStatus write_imaging (
    CameraControl &control, const ImagingParameters &parameters, ImagingParameters &written);
