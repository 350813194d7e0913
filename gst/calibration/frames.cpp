/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frames.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>

#include "common/elementproperties.hpp"

using rangecast::CameraRole;
using rangecast::StatusCode;

/* ---- sink pads ---- */

struct CalibratePadSettings {
  int view_id;
  CameraRole role;
};

struct _GstRigCalibratePad {
  GstAggregatorPad parent;
  CalibratePadSettings settings; /* guarded by the object lock */
};

G_DEFINE_TYPE (GstRigCalibratePad, gst_rig_calibrate_pad, GST_TYPE_AGGREGATOR_PAD)

static const GEnumValue kRoles[] = {
    {int (CameraRole::kLeft), "Left camera of a stereo pair, or the only camera of a view", "left"},
    {int (CameraRole::kRight), "Right camera of a stereo pair", "right"},
    {int (CameraRole::kThird), "Third camera of a view", "third"}, {}};

rangecast::CalibrationCamera
calibration_camera (GstRigCalibratePad *pad)
{
  rangecast::CalibrationCamera camera;
  GST_OBJECT_LOCK (pad);
  camera.name = GST_OBJECT_NAME (pad);
  camera.view_id = pad->settings.view_id;
  camera.role = pad->settings.role;
  GST_OBJECT_UNLOCK (pad);
  return camera;
}

static PropertyTable<CalibratePadSettings> &
pad_properties ()
{
  using P = PropertyTable<CalibratePadSettings>;
  static P table = {
      P::number<&CalibratePadSettings::view_id> ("view", "View",
          "view-id of the view that the camera belongs to (default: the number of the pad)", 0,
          rangecast::kMaxViews - 1, kMutableReady),
      P::enumeration<&CalibratePadSettings::role> ("role", "Role", "Role of the camera in its view",
          "GstRigCalibrateRole", kRoles, kMutableReady),
  };
  return table;
}

static void
gst_rig_calibrate_pad_init (GstRigCalibratePad *)
{
}

static void
gst_rig_calibrate_pad_class_init (GstRigCalibratePadClass *klass)
{
  install_pad_properties<GstRigCalibratePad, pad_properties> (G_OBJECT_CLASS (klass));
}

/* ---- images ---- */

CalibrationImages::~CalibrationImages ()
{
  for (GstBuffer *&buffer : buffers)
    gst_clear_buffer (&buffer);
}

MappedImages::MappedImages (CalibrationImages &set) : views (set.cameras.size ())
{
  for (std::size_t i = 0; i < set.cameras.size () && status.ok (); i++)
    if (set.buffers[i])
      open (set, i);
}

MappedImages::~MappedImages ()
{
  for (CameraInput *camera : open_)
    camera->reader.close ();
}

void
MappedImages::open (CalibrationImages &set, std::size_t i)
{
  CameraInput &camera = *set.cameras[i];
  const std::string &name = set.described[i].name;
  if (!camera.reader_info || !gst_video_info_is_equal (&*camera.reader_info, &set.infos[i])) {
    camera.reader_info.reset ();
    if (camera.reader.set (set.infos[i]))
      camera.reader_info = set.infos[i];
  }
  if (!camera.reader_info)
    status = {StatusCode::kUnsupported, "pad " + name + ": cannot convert the images to RGBx"};
  else if (!camera.reader.open (set.buffers[i]))
    status = {StatusCode::kBadData, "pad " + name + ": a buffer is smaller than its caps require"};
  else {
    open_.push_back (&camera);
    views[i] = camera.reader.view ();
  }
}

CameraHeads::CameraHeads (const CameraInputs &cameras, GstClockTime tolerance, bool live)
    : list (cameras.size ())
{
  GstClockTime shift = 0; /* from running to capture time */
  for (std::size_t i = 0; i < cameras.size (); i++) {
    PadStream &head = list[i];
    head.pad = cameras[i]->aggregator_pad ();
    head.peek (tolerance);
    if (head.head == MatchStream::Head::kFrame) {
      head.required = true;
      head.time = gstrange::capture_time_of (head.pad, head.buffer, live);
      shift = GST_CLOCK_TIME_IS_VALID (head.running) ? head.time - head.running : shift;
    }
    order.push_back (&head);
  }
  for (PadStream &head : list)
    if (head.head == MatchStream::Head::kGap)
      head.end += shift;
}

CameraHeads::~CameraHeads ()
{
  for (PadStream &head : list)
    head.release ();
}

GstClockTime
max_capture_skew (const CameraInputs &cameras)
{
  GstClockTime shortest = GST_CLOCK_TIME_NONE;
  for (const auto &camera : cameras)
    if (camera->info && camera->info->fps_n > 0)
      shortest = std::min (shortest,
          gst_util_uint64_scale_int (GST_SECOND, camera->info->fps_d, camera->info->fps_n));
  return gstrange::pairing_tolerance (shortest);
}

std::shared_ptr<CalibrationImages>
pop_images (const CameraInputs &cameras, const CameraHeads &heads, guint64 number)
{
  auto set = std::make_shared<CalibrationImages> ();
  set->cameras = cameras;
  set->buffers.resize (cameras.size ());
  set->number = number;
  for (const auto &camera : cameras) {
    rangecast::CalibrationCamera described = calibration_camera (camera->pad);
    described.width = camera->info->width;
    described.height = camera->info->height;
    set->described.push_back (std::move (described));
    set->infos.push_back (*camera->info);
  }
  for (std::size_t i = 0; i < cameras.size (); i++) {
    const PadStream &head = heads.list[i];
    if (!head.in_set)
      continue;
    set->buffers[i] = gst_aggregator_pad_pop_buffer (head.pad);
    set->capture = std::max (set->capture, head.time);
    set->running = std::min (set->running, head.running); /* NONE is the maximum */
  }
  if (!GST_CLOCK_TIME_IS_VALID (set->running))
    set->capture = number * 2 * GST_SECOND; /* unknown: so far apart that no motion is inferred */
  return set;
}
