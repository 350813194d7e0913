/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:provider-rangecastdeviceprovider
 * @title: rangecastdeviceprovider
 *
 * Lists the GigE Vision and USB3 Vision cameras that Aravis finds, and the stereo pairs of known
 * rigs whose cameras are all there. While it is started, it searches every 3 to 12 seconds, and
 * when libusb reports that a device was plugged in or unplugged.
 *
 * ## Example launch line
 * |[
 * gst-device-monitor-1.0 -f Video/Source
 * ]|
 *
 * Since: 0.1
 */
#include "cameradevices.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <libusb.h>
#include <mutex>
#include <set>
#include <utility>

#include "camera/aravis/camera.hpp"
#include "camera/aravis/discovery.hpp"

#define GST_TYPE_CAMERA_DEVICE_PROVIDER (gst_camera_device_provider_get_type ())
G_DECLARE_FINAL_TYPE (GstCameraDeviceProvider, gst_camera_device_provider, GST,
    CAMERA_DEVICE_PROVIDER, GstDeviceProvider)

GST_DEBUG_CATEGORY_STATIC (gst_camera_device_provider_debug);
#define GST_CAT_DEFAULT gst_camera_device_provider_debug

namespace {

/* The networks are searched often while cameras come and go, seldom where nothing happens: each
 * search is a broadcast, and keeps this process from opening cameras for a second. */
constexpr std::chrono::microseconds kMinPeriod = std::chrono::seconds (3);
constexpr std::chrono::microseconds kMaxPeriod = std::chrono::seconds (12);
/* A search takes about a second, more on a host with many networks; an application that starts a
 * monitor gets what was found by then, and the rest as messages. */
constexpr auto kMaxStart = std::chrono::milliseconds (1500);
/* After a USB device appeared: until udev has set its permissions. */
constexpr auto kUsbSettle = std::chrono::milliseconds (300);

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

/** Waits for USB devices that are plugged in or unplugged. */
class UsbHotplug {
public:
  UsbHotplug (const UsbHotplug &) = delete;
  UsbHotplug &operator= (const UsbHotplug &) = delete;
  UsbHotplug ()
  {
    if (libusb_init (&context_) != LIBUSB_SUCCESS)
      context_ = nullptr; // a host without USB
    constexpr auto both = LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT;
    const auto on_event = [] (libusb_context *, libusb_device *, libusb_hotplug_event, void *self) {
      static_cast<UsbHotplug *> (self)->changed_ = 1;
      return 0;
    };
    if (context_)
      libusb_hotplug_register_callback (context_, both, LIBUSB_HOTPLUG_NO_FLAGS,
          LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, on_event,
          this, nullptr);
  }
  ~UsbHotplug ()
  {
    if (context_)
      libusb_exit (context_);
  }

  [[nodiscard]] bool works () const { return context_ && !failed_; }
  /** @return whether a device came or went; false after `time` or wake(), which may come first, or
   *  when it no longer works */
  bool wait (std::chrono::microseconds time)
  {
    timeval tv{time.count () / 1'000'000, time.count () % 1'000'000};
    changed_ = 0;
    const int result = libusb_handle_events_timeout_completed (context_, &tv, &changed_);
    failed_ = result != LIBUSB_SUCCESS && result != LIBUSB_ERROR_INTERRUPTED;
    return changed_ != 0;
  }
  void wake ()
  {
    if (context_)
      libusb_interrupt_event_handler (context_);
  }

private:
  libusb_context *context_ = nullptr;
  int changed_ = 0; // this and the next: thread that waits only
  bool failed_ = false;
};

/** The search from start to stop, in a thread of its own because each one blocks for a second.
 *  Everything except what `lock` guards belongs to that thread. */
struct Watch {
  GstDeviceProvider *provider = nullptr;
  GThread *thread = nullptr;
  std::vector<CameraInfo> last_found; // by the last search
  std::vector<Announced<CameraInfo>> cameras;
  std::vector<Announced<KnownPair>> pairs;
  std::set<std::string> reported; // problems, each once
  UsbHotplug usb;

  std::mutex lock; // guards what follows; never held while searching or announcing
  std::condition_variable changed;
  std::atomic<bool> is_over = false; // read without lock while libusb waits
  bool is_listed = false;            // the first search has ended
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

/** Adds the pairs of known rigs, and logs problems, which users have to solve, once each. */
Present
find_pairs (
    GstDeviceProvider *provider, std::vector<CameraInfo> cameras, std::set<std::string> &reported)
{
  std::vector<std::string> problems;
  auto pairs = find_known_pairs (known_rig_files (), cameras, problems);
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
  std::set<std::string> reported;
  const auto now = find_pairs (provider, list_cameras (), reported);

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

/** Announces the cameras that answered this search or the last one, since answers are UDP and may
 *  be lost. @return whether nothing has changed */
bool
search (Watch &watch)
{
  auto found = list_cameras ();
  auto present = found;
  for (const auto &last : watch.last_found)
    if (std::ranges::none_of (found, [&] (const auto &camera) { return camera.id == last.id; }))
      present.push_back (last);
  const bool is_same = found == watch.last_found && present.size () == found.size ();
  watch.last_found = std::move (found);
  const auto now = find_pairs (watch.provider, std::move (present), watch.reported);
  announce (watch.provider, watch.cameras, now.cameras, new_camera_device);
  announce (watch.provider, watch.pairs, now.pairs, new_pair_device);
  return is_same;
}

void
wait_for_next_search (Watch &watch, std::chrono::microseconds period)
{
  if (watch.usb.works ()) {
    if (watch.usb.wait (period) && !watch.is_over)
      watch.usb.wait (kUsbSettle);
    return;
  }
  std::unique_lock guard (watch.lock);
  watch.changed.wait_for (guard, period, [&] { return watch.is_over.load (); });
}

gpointer
run_watch (gpointer data)
{
  auto &watch = *static_cast<Watch *> (data);
  auto period = kMinPeriod;
  std::unique_lock guard (watch.lock);
  while (!watch.is_over) {
    guard.unlock ();
    period = search (watch) ? std::min (2 * period, kMaxPeriod) : kMinPeriod;
    guard.lock ();
    watch.is_listed = true;
    watch.changed.notify_all ();
    guard.unlock ();
    wait_for_next_search (watch, period);
    guard.lock ();
  }
  return nullptr;
}

} // namespace

static gboolean
gst_camera_device_provider_start (GstDeviceProvider *provider)
{
  auto self = GST_CAMERA_DEVICE_PROVIDER (provider);
  self->watch = new Watch;
  auto &watch = *self->watch;
  watch.provider = provider;
  watch.thread = g_thread_try_new ("camera-discovery", run_watch, &watch, nullptr);
  if (!watch.thread) {
    GST_ERROR_OBJECT (provider, "could not start the camera discovery thread");
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
  self->watch->usb.wake ();
  g_thread_join (self->watch->thread);
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
