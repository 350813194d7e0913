/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:provider-rangecastdeviceprovider
 * @title: rangecastdeviceprovider
 *
 * Lists machine-vision cameras, GigE Vision by Aravis' discovery and USB3 Vision by libusb, and the
 * stereo pairs of known rigs whose cameras are all there. While it is started, USB cameras appear
 * and disappear as they are plugged; the networks are asked again every 3 to 12 seconds.
 *
 * ## Example launch line
 * |[
 * gst-device-monitor-1.0 -f Video/Source
 * ]|
 *
 * Since: 0.1
 */
#include "gstcameradeviceprovider.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "camera/aravis/camera.hpp"
#include "camera/aravis/user_name.hpp"
#include "cameradevices.hpp"
#include "usbcameras.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_camera_device_provider_debug);
#define GST_CAT_DEFAULT gst_camera_device_provider_debug

namespace {

using Clock = std::chrono::steady_clock;

/* The networks are searched often while cameras come and go, seldom where nothing happens: each
 * search is a broadcast, and keeps this process from opening cameras for a second. */
constexpr Clock::duration kMinPeriod = std::chrono::seconds (3);
constexpr Clock::duration kMaxPeriod = std::chrono::seconds (12);
/* A search takes about a second, more on a host with many networks; an application that starts a
 * monitor gets what was found by then, and the rest as messages. */
constexpr auto kMaxStart = std::chrono::milliseconds (1500);
constexpr int kMaxMisses = 1; // answers to discovery are UDP and may be lost

/** What devices are made from. */
struct Present {
  std::vector<CameraInfo> cameras;
  std::vector<KnownPair> pairs;
};

/** A device that was announced, and what it was made from. */
template <typename Source> struct Announced {
  Source source;
  GstDevice *device; // the provider's list owns it
};

/** The search from start to stop, in a thread of its own because each one blocks for a second.
 *  Everything except what `lock` guards belongs to that thread. */
struct Watch {
  GstDeviceProvider *provider = nullptr;
  std::thread thread;
  std::vector<CameraInfo> gige, usb_cameras;
  std::vector<int> gige_misses; // in a row, per camera of `gige`
  std::vector<Announced<CameraInfo>> cameras;
  std::vector<Announced<KnownPair>> pairs;
  std::set<std::string> reported; // problems, each once
  KnownRigs rigs;

  std::mutex lock; // guards what follows; never held while searching or announcing
  std::condition_variable changed;
  bool is_over = false;
  bool has_usb_changed = false;
  bool is_listed = false; // the first search has ended

  std::unique_ptr<UsbCameras> usb; // destroyed first: its thread uses the above
};

} // namespace

struct _GstCameraDeviceProvider {
  GstDeviceProvider parent;
  Watch *watch; // null while stopped
};

G_DEFINE_TYPE (GstCameraDeviceProvider, gst_camera_device_provider, GST_TYPE_DEVICE_PROVIDER)
GST_DEVICE_PROVIDER_REGISTER_DEFINE (rangecastdeviceprovider, "rangecastdeviceprovider",
    GST_RANK_PRIMARY, GST_TYPE_CAMERA_DEVICE_PROVIDER)

namespace {

/** A camera's user-defined name, which is not part of discovery. A camera is asked until it
 *  answers, and then no more while it stays. */
std::optional<std::string>
user_name_of (const CameraInfo &info, const std::vector<CameraInfo> &known)
{
  const auto is_same = [&] (const CameraInfo &camera) {
    return camera.id == info.id && camera.address == info.address;
  };
  const auto at = std::ranges::find_if (known, is_same);
  return at != known.end () && at->user_name ? at->user_name : read_user_name (info.address);
}

/** The GigE Vision cameras that answer, in about a second. USB cameras come from libusb, which has
 *  hotplug and permissions. @param known  those that answered before */
std::vector<CameraInfo>
find_gige_cameras (const std::vector<CameraInfo> &known)
{
  std::vector<CameraInfo> found;
  for (auto &info : list_cameras ())
    if (info.is_gige ()) {
      info.user_name = user_name_of (info, known);
      found.push_back (std::move (info));
    }
  return found;
}

std::unique_ptr<UsbCameras>
open_usb (GstDeviceProvider *provider)
{
  std::string why;
  auto usb = UsbCameras::open (why);
  if (!usb)
    GST_WARNING_OBJECT (provider, "no USB cameras: %s", why.c_str ());
  return usb;
}

/** Adds the pairs of known rigs, and logs problems, which users have to solve, once each. */
Present
find_pairs (GstDeviceProvider *provider, KnownRigs &rigs, std::vector<CameraInfo> cameras,
    std::set<std::string> &reported)
{
  std::vector<std::string> problems;
  auto pairs = rigs.pairs (known_rig_files (), cameras, problems);
  for (const auto &camera : cameras)
    problems.push_back (camera.problem);
  for (const auto &problem : problems)
    if (!problem.empty () && reported.insert (problem).second)
      GST_WARNING_OBJECT (provider, "%s", problem.c_str ());
  return {.cameras = std::move (cameras), .pairs = std::move (pairs)};
}

} // namespace

static GList *
gst_camera_device_provider_probe (GstDeviceProvider *provider)
{
  auto cameras = find_gige_cameras ({});
  if (auto usb = open_usb (provider))
    std::ranges::copy (usb->list (), std::back_inserter (cameras));
  std::set<std::string> reported;
  KnownRigs rigs;
  const auto now = find_pairs (provider, rigs, std::move (cameras), reported);

  GList *devices = nullptr;
  for (const auto &camera : now.cameras)
    devices = g_list_prepend (devices, gst_object_ref_sink (new_camera_device (camera)));
  for (const auto &pair : now.pairs)
    devices = g_list_prepend (devices, gst_object_ref_sink (new_pair_device (pair)));
  return g_list_reverse (devices);
}

namespace {

/** Announces what was added and removed. A device whose properties changed is removed and added. */
template <typename Source>
void
announce (GstDeviceProvider *provider, std::vector<Announced<Source>> &announced,
    const std::vector<Source> &now, GstDevice *(*new_device) (const Source &))
{
  std::erase_if (announced, [&] (const Announced<Source> &old) {
    const bool is_gone = std::ranges::find (now, old.source) == now.end ();
    if (is_gone) {
      GST_DEBUG_OBJECT (provider, "removing %" GST_PTR_FORMAT, old.device);
      gst_device_provider_device_remove (provider, old.device);
    }
    return is_gone;
  });
  for (const auto &source : now)
    if (std::ranges::find (announced, source, &Announced<Source>::source) == announced.end ()) {
      GstDevice *device = new_device (source);
      GST_DEBUG_OBJECT (provider, "adding %" GST_PTR_FORMAT, device);
      gst_device_provider_device_add (provider, device);
      announced.push_back ({.source = source, .device = device});
    }
}

/** Lists the cameras that answered, and those that missed no more than kMaxMisses searches.
 *  @return whether nothing has changed */
bool
discover_gige (Watch &watch)
{
  auto answered = find_gige_cameras (watch.gige);
  std::vector<int> misses (answered.size (), 0);
  for (std::size_t i = 0; i < watch.gige.size (); ++i) {
    const auto is_same = [&] (const CameraInfo &camera) { return camera.id == watch.gige[i].id; };
    if (std::ranges::none_of (answered, is_same) && watch.gige_misses[i] < kMaxMisses) {
      answered.push_back (watch.gige[i]);
      misses.push_back (watch.gige_misses[i] + 1);
    }
  }
  const bool is_same =
      answered == watch.gige && std::ranges::count (misses, 0) == std::ssize (misses);
  watch.gige = std::move (answered);
  watch.gige_misses = std::move (misses);
  return is_same;
}

void
update (Watch &watch)
{
  auto cameras = watch.gige;
  std::ranges::copy (watch.usb_cameras, std::back_inserter (cameras));
  const auto now = find_pairs (watch.provider, watch.rigs, std::move (cameras), watch.reported);
  announce (watch.provider, watch.cameras, now.cameras, new_camera_device);
  announce (watch.provider, watch.pairs, now.pairs, new_pair_device);
}

/** Waits until it is time to search.
 *  @param[out] is_usb  whether USB devices came or went
 *  @return false if the provider stops */
bool
wait_for_change (Watch &watch, Clock::time_point until, bool &is_usb)
{
  std::unique_lock guard (watch.lock);
  watch.changed.wait_until (guard, until, [&] { return watch.is_over || watch.has_usb_changed; });
  is_usb = std::exchange (watch.has_usb_changed, false);
  return !watch.is_over;
}

void
run_watch (Watch &watch)
{
  auto period = kMinPeriod;
  auto next_discovery = Clock::now ();
  bool is_usb = true;
  do {
    if (is_usb && watch.usb)
      watch.usb_cameras = watch.usb->list ();
    if (Clock::now () >= next_discovery) {
      period = discover_gige (watch) ? std::min (2 * period, kMaxPeriod) : kMinPeriod;
      next_discovery = Clock::now () + period;
    }
    update (watch);
    {
      const std::lock_guard guard (watch.lock);
      watch.is_listed = true;
    }
    watch.changed.notify_all ();
  } while (wait_for_change (watch, next_discovery, is_usb));
}

} // namespace

static gboolean
gst_camera_device_provider_start (GstDeviceProvider *provider)
{
  auto self = GST_CAMERA_DEVICE_PROVIDER (provider);
  self->watch = new Watch;
  auto &watch = *self->watch;
  watch.provider = provider;
  watch.usb = open_usb (provider);
  const auto on_usb = [&watch] {
    const std::lock_guard guard (watch.lock);
    watch.has_usb_changed = true;
    watch.changed.notify_all ();
  };
  if (watch.usb && !watch.usb->watch (on_usb))
    GST_WARNING_OBJECT (provider, "libusb does not support hotplug on this host");
  try {
    watch.thread = std::thread ([&watch] { run_watch (watch); });
  } catch (const std::system_error &error) {
    GST_ERROR_OBJECT (provider, "could not start the camera discovery thread: %s", error.what ());
    delete std::exchange (self->watch, nullptr);
    return FALSE;
  }
  std::unique_lock guard (watch.lock);
  watch.changed.wait_for (guard, kMaxStart, [&] { return watch.is_listed; });
  return TRUE;
}

static void
gst_camera_device_provider_stop (GstDeviceProvider *provider)
{
  auto self = GST_CAMERA_DEVICE_PROVIDER (provider);
  if (!self->watch)
    return;
  {
    const std::lock_guard guard (self->watch->lock);
    self->watch->is_over = true;
  }
  self->watch->changed.notify_all ();
  self->watch->thread.join ();
  self->watch->usb.reset (); // its thread uses the watch
  delete std::exchange (self->watch, nullptr);
}

static void
gst_camera_device_provider_init (GstCameraDeviceProvider *)
{
}

static void
gst_camera_device_provider_class_init (GstCameraDeviceProviderClass *klass)
{
  auto provider_class = GST_DEVICE_PROVIDER_CLASS (klass);
  provider_class->probe = GST_DEBUG_FUNCPTR (gst_camera_device_provider_probe);
  provider_class->start = GST_DEBUG_FUNCPTR (gst_camera_device_provider_start);
  provider_class->stop = GST_DEBUG_FUNCPTR (gst_camera_device_provider_stop);
  gst_device_provider_class_set_static_metadata (provider_class,
      "Machine-vision cameras and stereo pairs", "Source/Video/Stereo",
      "Lists GigE Vision and USB3 Vision cameras, and the stereo pairs of known rigs",
      "gst-rangecast");
  GST_DEBUG_CATEGORY_INIT (gst_camera_device_provider_debug, "rangecastdeviceprovider", 0,
      "Machine-vision cameras and stereo pairs");
}
