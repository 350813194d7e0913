/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "camera.hpp"
#include "control.hpp"

/** The steps of Camera::configure(), in the order that cameras need. All may wait for the camera.
 */
CameraStatus read_abilities (CameraControl &control, CameraAbilities &abilities);
CameraStatus set_transport (CameraControl &control, const CameraSettings &settings);
/** Pixel format, region. */
CameraStatus set_image (
    CameraControl &control, const CameraSettings &settings, CameraFormat &format);
CameraStatus set_trigger (CameraControl &control, const CameraSettings &settings);
/** Exposure, gain, white balance, frame rate. */
CameraStatus set_imaging (CameraControl &control, const CameraSettings &settings);

/* Not at the same time: selectors and latches are state. */
CameraStatus read_imaging (CameraControl &control, ImagingParameters &parameters);
/** Sets the values that differ from `written` by more than a thousandth, and records them there. */
CameraStatus write_imaging (
    CameraControl &control, const ImagingParameters &parameters, ImagingParameters &written);
/** @param[out] time_ns     on the camera's clock
 *  @param[out] read_at_us  middle of the round trip that latched it, g_get_monotonic_time */
CameraStatus read_clock (CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us);
