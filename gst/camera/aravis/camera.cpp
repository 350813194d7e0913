/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camera.hpp"

#include <arv.h>
#include <atomic>
#include <mutex>

#include "control.hpp"
#include "discovery.hpp"
#include "setup.hpp"
#include "stream.hpp"

namespace {

constexpr std::size_t kMinSocketBuffer = 1 << 20; /* bytes */
/* Then a packet counts as missing. Aravis looks for images to give up in pauses of this length,
 * else with the first packet of an image: one that gets the only free buffer after it is
 * incomplete, too, and so on. */
constexpr guint kPacketTimeout_us = 5000;
constexpr guint kFrameRetention_us = 100000;    /* then an incomplete image is given up */
constexpr std::size_t kMaxChunkBytes = 1 << 20; /* that chunk data may add to an image */

std::string
lost_text (const std::string &label)
{
  return label +
         ": the camera no longer responds; check power and cable, and that no other program "
         "controls it";
}

/* Handles the device's signal control-lost, which may be emitted while the camera is deleted. */
struct LossWatch {
  std::mutex lock; /* guards report, held while it runs */
  Camera::Lost report;
  std::string label;
  std::atomic<bool> lost{false};

  void on_lost ()
  {
    if (lost.exchange (true))
      return;
    std::lock_guard guard (lock);
    if (report)
      report ({CameraFault::kLost, lost_text (label)});
  }
};

} // namespace

struct Camera::Impl {
  CameraInfo info;
  std::string interface;
  std::unique_ptr<CameraControl> control;
  CameraSettings settings;
  CameraFormat format;
  std::shared_ptr<LossWatch> watch = std::make_shared<LossWatch> ();
  gulong watch_handler = 0;

  std::mutex run_lock; /* guards what follows */
  std::shared_ptr<CameraRun> run;
  CameraStatistics last_statistics;

  /* Guards what follows, and features of two parts (a selector and its value, a latch and its
   * register). Taken before the control's lock, which triggers wait for and which is therefore held
   * for one feature at a time. */
  std::mutex imaging_lock;
  ImagingParameters written;

  void describe ();
  CameraStatus create_stream (const std::shared_ptr<CameraRun> &run);
  void set_stream_properties (ArvStream *stream) const;
  CameraStatus fill (CameraRun &run);
  [[nodiscard]] CameraStatus check_not_lost () const
  {
    return watch->lost ? CameraStatus (CameraFault::kLost, lost_text (control->label ()))
                       : CameraStatus ();
  }
  /* Any fault of a camera that was lost is the loss. */
  CameraStatus classify (CameraStatus status) const
  {
    if (status.ok () || !watch->lost)
      return status;
    return {CameraFault::kLost, status.message ()};
  }
};

/* ---- opening ---- */

void
Camera::Impl::describe ()
{
  ArvCamera *camera = control->camera ();
  if (info.vendor.empty ())
    info.vendor = valid_utf8 (arv_camera_get_vendor_name (camera, nullptr));
  if (info.model.empty ())
    info.model = valid_utf8 (arv_camera_get_model_name (camera, nullptr));
  if (info.serial.empty ())
    info.serial = valid_utf8 (arv_camera_get_device_serial_number (camera, nullptr));
  if (info.id.empty ())
    info.id = info.vendor + "-" + info.serial;
  if (!ARV_IS_GV_DEVICE (control->device ()))
    return;
  const auto address = [] (GSocketAddress *socket_address) {
    gchar *text = g_inet_address_to_string (
        g_inet_socket_address_get_address (G_INET_SOCKET_ADDRESS (socket_address)));
    std::string copy = text;
    g_free (text);
    return copy;
  };
  ArvGvDevice *device = ARV_GV_DEVICE (control->device ());
  interface = address (arv_gv_device_get_interface_address (device));
  info.address = address (arv_gv_device_get_device_address (device));
}

CameraStatus
Camera::open (const std::string &name, std::unique_ptr<Camera> &camera, CameraInfo *seen)
{
  auto impl = std::make_unique<Impl> ();
  ArvDevice *device = nullptr;
  CameraStatus status = open_camera_device (name, device, impl->info);
  if (seen)
    *seen = impl->info;
  if (!status.ok ())
    return status;
  GError *error = nullptr;
  ArvCamera *arv = arv_camera_new_with_device (device, &error);
  g_object_unref (device);
  if (!arv) {
    status = {CameraFault::kFailed,
        "camera '" + name + "': " + (error ? error->message : "Aravis cannot use it")};
    g_clear_error (&error);
    return status;
  }
  g_clear_error (&error);
  std::string label = "camera '" + valid_utf8 (name) + "'";
  if (!impl->info.model.empty () && impl->info.id != name)
    label +=
        " (" + impl->info.vendor + " " + impl->info.model + ", serial " + impl->info.serial + ")";
  impl->control = std::make_unique<CameraControl> (arv, label);
  impl->describe ();
  impl->watch->label = label;
  impl->watch_handler = g_signal_connect_data (
      impl->control->device (), "control-lost", G_CALLBACK (+[] (ArvDevice *, gpointer watch) {
        (*static_cast<std::shared_ptr<LossWatch> *> (watch))->on_lost ();
      }),
      new std::shared_ptr<LossWatch> (impl->watch),
      [] (gpointer watch, GClosure *) { delete static_cast<std::shared_ptr<LossWatch> *> (watch); },
      GConnectFlags (0));
  camera.reset (new Camera (std::move (impl)));
  return {};
}

Camera::Camera (std::unique_ptr<Impl> impl) : impl_ (std::move (impl)) {}

Camera::~Camera ()
{
  stop ();
  g_signal_handler_disconnect (impl_->control->device (), impl_->watch_handler);
}

const CameraInfo &
Camera::info () const
{
  return impl_->info;
}

const std::string &
Camera::label () const
{
  return impl_->control->label ();
}

const std::string &
Camera::interface_address () const
{
  return impl_->interface;
}

/* ---- configuration ---- */

CameraStatus
Camera::abilities (CameraAbilities &abilities)
{
  return impl_->classify (read_abilities (*impl_->control, abilities));
}

CameraStatus
Camera::configure (const CameraSettings &settings)
{
  CameraControl &control = *impl_->control;
  impl_->settings = settings;
  CameraStatus status = set_transport (control, settings);
  if (status.ok ())
    status = set_image (control, settings, impl_->format);
  if (status.ok ())
    status = set_trigger (control, settings);
  if (status.ok ())
    status = set_imaging (control, settings);
  if (status.ok ())
    status = control.assign_features (settings.features);
  std::lock_guard guard (impl_->imaging_lock);
  impl_->written = {};
  return impl_->classify (status);
}

/* ---- streaming ---- */

void
Camera::Impl::set_stream_properties (ArvStream *stream) const
{
  if (!ARV_IS_GV_STREAM (stream))
    return;
  g_object_set (
      stream, "packet-timeout", kPacketTimeout_us, "frame-retention", kFrameRetention_us, nullptr);
  if (!settings.packet_resend) /* else if the camera can */
    g_object_set (stream, "packet-resend", ARV_GV_STREAM_PACKET_RESEND_NEVER, nullptr);
  /* Aravis would take the size of one image, which is too little for small ones */
  const std::size_t wanted = std::max (2 * format.size (), kMinSocketBuffer);
  const int bytes = int (std::min<std::size_t> (wanted, G_MAXINT));
  g_object_set (stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
      bytes, nullptr);
}

CameraStatus
Camera::Impl::create_stream (const std::shared_ptr<CameraRun> &run)
{
  const auto guard = control->lock ();
  GError *error = nullptr;
  ArvStream *stream = arv_camera_create_stream_full (
      control->camera (),
      [] (void *data, ArvStreamCallbackType type, ArvBuffer *) {
        if (type == ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE)
          static_cast<CameraRun *> (data)->on_done ();
      },
      run.get (), nullptr, &error); /* which lives until the stream is deleted */
  if (!stream)
    return error ? control->status ("stream", error, CameraFault::kFailed)
                 : control->refuse (CameraFault::kFailed, "the camera does not provide a stream");
  g_clear_error (&error);
  set_stream_properties (stream);
  std::lock_guard run_guard (run->lock);
  run->stream = stream;
  run->store = std::make_shared<FrameStore> (stream, format);
  return {};
}

CameraStatus
Camera::Impl::fill (CameraRun &run)
{
  GError *error = nullptr;
  const auto guard = control->lock ();
  const guint payload = arv_camera_get_payload (control->camera (), &error);
  CameraStatus status = control->status ("payload size", error, CameraFault::kFailed);
  if (status.ok () && (payload < format.size () || payload > 2 * format.size () + kMaxChunkBytes))
    status = control->refuse (CameraFault::kUnsupported,
        "the camera sends " + std::to_string (payload) + " bytes an image, not the " +
            std::to_string (format.size ()) + " of " + std::to_string (format.width) + "x" +
            std::to_string (format.height) + " " + settings.pixel_format);
  if (!status.ok ())
    return status;
  run.store->fill (settings.n_buffers, payload);
  return {};
}

CameraStatus
Camera::start (Arrived arrived, Lost lost)
{
  CameraControl &control = *impl_->control;
  if (CameraStatus lost = impl_->check_not_lost (); !lost.ok ())
    return lost;
  stop ();
  auto run = std::make_shared<CameraRun> ();
  run->arrived = std::move (arrived);
  run->format = impl_->format;
  run->counter = FrameCounter (
      ARV_IS_GV_DEVICE (control.device ()) ? FrameCounter::Ids::kGigE : FrameCounter::Ids::kUsb);
  CameraStatus status = impl_->create_stream (run);
  if (!status.ok ())
    return impl_->classify (status);
  {
    std::lock_guard guard (impl_->watch->lock);
    impl_->watch->report = std::move (lost);
  }
  status = impl_->fill (*run);
  {
    std::lock_guard guard (impl_->run_lock);
    impl_->run = run;
    impl_->last_statistics = {};
  }
  if (status.ok ()) {
    const auto guard = control.lock ();
    GError *error = nullptr;
    arv_camera_start_acquisition (control.camera (), &error);
    status = control.status ("start of acquisition", error, CameraFault::kFailed);
  }
  if (!status.ok ())
    stop ();
  return impl_->classify (status);
}

/* Stops acquisition, then the receiving thread, then releases the buffers. */
void
Camera::stop ()
{
  {
    std::lock_guard guard (impl_->watch->lock);
    impl_->watch->report = nullptr;
  }
  std::shared_ptr<CameraRun> run;
  {
    std::lock_guard guard (impl_->run_lock);
    run = std::move (impl_->run);
    impl_->run = nullptr;
    if (!run)
      return;
    impl_->last_statistics = run->statistics ();
  }
  {
    std::lock_guard guard (run->lock);
    run->stopped = true;
    run->arrived = nullptr;
  }
  run->store->close ();
  if (!impl_->watch->lost) {
    const auto guard = impl_->control->lock ();
    arv_camera_stop_acquisition (impl_->control->camera (), nullptr);
  }
  g_object_unref (run->stream);
}

CameraStatus
Camera::loss_or_fault (const CameraStatus &status)
{
  const CameraFault fault = status.fault ();
  if (fault != CameraFault::kTimedOut && fault != CameraFault::kLost && fault != CameraFault::kBusy)
    return status;
  impl_->watch->lost = true;
  return impl_->check_not_lost ();
}

CameraStatistics
Camera::statistics () const
{
  std::lock_guard guard (impl_->run_lock);
  if (!impl_->run)
    return impl_->last_statistics;
  CameraStatistics numbers = impl_->run->statistics ();
  numbers.buffers_out = impl_->run->store->out ();
  return numbers;
}

/* ---- features while streaming ---- */

CameraStatus
Camera::trigger_software ()
{
  CameraControl &control = *impl_->control;
  if (CameraStatus lost = impl_->check_not_lost (); !lost.ok ())
    return lost;
  const auto guard = control.lock ();
  GError *error = nullptr;
  arv_camera_software_trigger (control.camera (), &error);
  return impl_->classify (control.status ("software trigger", error));
}

CameraStatus
Camera::read_imaging (ImagingParameters &parameters)
{
  if (CameraStatus lost = impl_->check_not_lost (); !lost.ok ())
    return lost;
  std::lock_guard guard (impl_->imaging_lock);
  return impl_->classify (::read_imaging (*impl_->control, parameters));
}

CameraStatus
Camera::write_imaging (const ImagingParameters &parameters)
{
  if (CameraStatus lost = impl_->check_not_lost (); !lost.ok ())
    return lost;
  std::lock_guard guard (impl_->imaging_lock);
  return impl_->classify (::write_imaging (*impl_->control, parameters, impl_->written));
}

CameraStatus
Camera::read_clock (std::uint64_t &camera_time_ns, std::int64_t &read_at_us)
{
  if (CameraStatus lost = impl_->check_not_lost (); !lost.ok ())
    return lost;
  std::lock_guard guard (impl_->imaging_lock);
  return impl_->classify (::read_clock (*impl_->control, camera_time_ns, read_at_us));
}
