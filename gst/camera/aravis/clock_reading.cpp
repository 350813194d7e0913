/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clock_reading.hpp"

#include <algorithm>
#include <gst/gst.h>

namespace {

/* Bootstrap registers of GigE Vision, which every camera has. The latch holds the clock for
 * reading.
 */
constexpr guint64 kTimestampControl = 0x0944, kTimestampHigh = 0x0948, kTimestampLow = 0x094c;
constexpr guint32 kTimestampLatch = 2;

std::uint64_t
ticks_to_ns (std::uint64_t ticks, std::uint64_t frequency)
{
  constexpr std::uint64_t kSecond = 1'000'000'000;
  if (frequency == 0)
    return 0;
  return ticks / frequency * kSecond +
         gst_util_uint64_scale (ticks % frequency, kSecond, frequency);
}

} // namespace

/* Registers need no lock, unlike features. */
CameraStatus
read_gige_clock (
    CameraControl &control, guint64 &frequency, std::uint64_t &time_ns, std::int64_t &read_at_us)
{
  ArvDevice *device = control.device ();
  GError *error = nullptr;
  guint32 high = 0, low = 0;
  if (frequency == 0)
    frequency = arv_gv_device_get_timestamp_tick_frequency (ARV_GV_DEVICE (device), &error);
  const std::int64_t before = g_get_monotonic_time ();
  if (!error)
    arv_device_write_register (device, kTimestampControl, kTimestampLatch, &error);
  read_at_us = (before + g_get_monotonic_time ()) / 2;
  if (!error)
    arv_device_read_register (device, kTimestampHigh, &high, &error);
  if (!error)
    arv_device_read_register (device, kTimestampLow, &low, &error);
  if (!error)
    time_ns = ticks_to_ns (std::uint64_t (high) << 32 | low, frequency);
  return control.status ("its clock", error, CameraFault::kFailed);
}

CameraStatus
read_usb_clock (CameraControl &control, std::uint64_t &time_ns, std::int64_t &read_at_us)
{
  std::int64_t ticks = 0;
  const std::int64_t before = g_get_monotonic_time ();
  CameraStatus status = control.execute ("TimestampLatch");
  read_at_us = (before + g_get_monotonic_time ()) / 2;
  if (status.ok () && !control.read ("TimestampLatchValue", ticks))
    return control.refuse (CameraFault::kFailed, "the camera has no feature 'TimestampLatchValue'");
  time_ns = static_cast<std::uint64_t> (std::max<std::int64_t> (ticks, 0)); /* USB3 Vision: ns */
  return status;
}
