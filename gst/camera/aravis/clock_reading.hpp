/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

#include "control.hpp"

/* Reads a camera's clock. read_at_us is the middle of the round trip that latched it,
 * g_get_monotonic_time, microseconds. */

/** @param frequency     of the clock, Hz; 0: not yet read, then it is read
 *  @param[out] time_ns  on the camera's clock; 0: unknown */
CameraStatus read_gige_clock (
    CameraControl &control, guint64 &frequency, std::uint64_t &time_ns, std::int64_t &read_at_us);
CameraStatus read_usb_clock (
    CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us);
