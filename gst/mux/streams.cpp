/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streams.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrangestatus.hpp>
#include <numbers>
#include <rangecast/geometry/rectified_pose.hpp>

#include "common/elementproperties.hpp"

using rangecast::Pose;
using rangecast::Rig;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

/* ---- sink pads ---- */

struct MuxPadSettings {
  int view_id_offset;
  double x, y, z, yaw;
};

struct _GstRangeMuxPad {
  GstAggregatorPad parent;
  MuxPadSettings settings; /* guarded by the object lock */
};

G_DEFINE_TYPE (GstRangeMuxPad, gst_range_mux_pad, GST_TYPE_AGGREGATOR_PAD)

int
place_rig (GstRangeMuxPad *pad, Rig &rig)
{
  GST_OBJECT_LOCK (pad);
  const MuxPadSettings s = pad->settings;
  GST_OBJECT_UNLOCK (pad);
  const double angle = s.yaw * std::numbers::pi / 180, c = std::cos (angle), n = std::sin (angle);
  const Pose world_from_rig = {{c, 0, n, 0, 1, 0, -n, 0, c}, {s.x, s.y, s.z}};
  for (View &view : rig.views) {
    view.id += s.view_id_offset;
    if (s.x != 0 || s.y != 0 || s.z != 0 ||
        s.yaw != 0) /* else the rig stays the same in each bit */
      view.world_from_view = world_from_rig * view.world_from_view;
  }
  return s.view_id_offset;
}

static PropertyTable<MuxPadSettings> &
pad_properties ()
{
  using P = PropertyTable<MuxPadSettings>;
  static P table = {
      P::number<&MuxPadSettings::view_id_offset> ("view-id-offset", "View-id offset",
          "Added to the stream's view-ids, so that several rigs with equal ones make one scene", 0,
          rangecast::kMaxViews - 1, kMutableReady),
      P::number<&MuxPadSettings::x> (
          "x", "X", "x of the stream's origin in the scene in metres", -1000, 1000, kMutableReady),
      P::number<&MuxPadSettings::y> ("y", "Y",
          "y (height) of the stream's origin in the scene in metres", -1000, 1000, kMutableReady),
      P::number<&MuxPadSettings::z> (
          "z", "Z", "z of the stream's origin in the scene in metres", -1000, 1000, kMutableReady),
      P::number<&MuxPadSettings::yaw> ("yaw", "Yaw",
          "Rotation of the stream about its vertical axis in degrees, counterclockwise seen from "
          "above",
          -360, 360, kMutableReady),
  };
  return table;
}

static void
gst_range_mux_pad_init (GstRangeMuxPad *)
{
}

static void
gst_range_mux_pad_class_init (GstRangeMuxPadClass *klass)
{
  install_pad_properties<GstRangeMuxPad, pad_properties> (G_OBJECT_CLASS (klass));
}

/* ---- streams ---- */

void
MuxStream::reset ()
{
  release ();
  has_caps = coded = chosen = alive = late = shift_known = false;
  in_sync = true;
  other_rig = clash = {};
  seen = since = GST_CLOCK_TIME_NONE;
  reported = state = StreamState::kIn;
  received = dropped_late = out_of_sync = skipped = matched = views = 0;
  skew = shift = 0;
  late_in_row = 0;
  offset = 0;
}

std::string
MuxStream::title () const
{
  std::string text = std::string ("pad ") + GST_PAD_NAME (pad);
  if (has_caps)
    text += " (view " + std::to_string (info.rig.views.front ().id) + ")";
  return text;
}

GstStructure *
MuxStream::stats () const
{
  return gst_structure_new ("pad", "received", G_TYPE_UINT64, received, "matched", G_TYPE_UINT64,
      matched, "late", G_TYPE_UINT64, dropped_late, "out-of-sync", G_TYPE_UINT64, out_of_sync,
      "skipped", G_TYPE_UINT64, skipped, "skew", G_TYPE_INT64, gint64 (skew), "state",
      G_TYPE_STRING, name_of (state), "offset", G_TYPE_INT64, gint64 (offset.load ()), nullptr);
}

StatsRow
MuxStream::row (guint64 frames) const
{
  return {.pad = GST_PAD_NAME (pad),
      .counters = {.frames = received,
          .lost = frames - std::min (frames, matched),
          .late = dropped_late + out_of_sync},
      .views = views};
}

/* ---- cameras of another rig ---- */

namespace {

/* The same calibration read again, or rectified by another build, differs by rounding; a new
 * calibration by more. Position in metres, elements of the rotation matrix, relative focal length.
 */
constexpr double kMaxDistance_m = 1e-3, kMaxRotation = 2e-3, kMaxScale = 2e-3;
/* Rectification scales the focal length, by an amount that depends on the lenses, so that no pixel
 * stays empty. */
constexpr double kMaxRectifiedScale = 0.5;

Status
differs (const View &view, const std::string &what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + " is not that of the rig: " +
                                     what + "; give the camera host the same rig file"};
}

Status
check_view (const View &view, View expected)
{
  if (Status s = rangecast::scale_view (expected, view.width, view.height); !s.ok ())
    return differs (view, std::to_string (view.width) + "x" + std::to_string (view.height) +
                              " pixels; the rig has the shape of " +
                              std::to_string (expected.width) + "x" +
                              std::to_string (expected.height));
  double max_scale = kMaxScale;
  if (expected.right) {
    rangecast::Pose left_from_rectified;
    left_from_rectified.rotation =
        rangecast::transposed (rangecast::rectifying_rotation (expected.right->partner_from_left));
    expected.world_from_view = expected.world_from_view * left_from_rectified;
    if (!rangecast::is_rectified (expected))
      max_scale = kMaxRectifiedScale;
  }
  const rangecast::Pose &p = view.world_from_view, &q = expected.world_from_view;
  if (const double apart = rangecast::norm (p.translation - q.translation);
      !(apart <= kMaxDistance_m))
    return differs (view, "its position is " + std::to_string (apart) + " m off");
  const auto is_near = [] (double a, double b) { return std::abs (a - b) <= kMaxRotation; };
  if (!std::ranges::equal (p.rotation, q.rotation, is_near))
    return differs (view, "its orientation differs");
  const double scale = view.intrinsics.fx / expected.intrinsics.fx;
  if (!(std::abs (scale - 1) <= max_scale))
    return differs (
        view, "its focal length is " + std::to_string (scale) + " times that of the rig");
  return {};
}

} // namespace

Status
check_rig (const Rig &stream, const Rig &expected)
{
  for (const View &view : stream.views) {
    const View *known = expected.find (view.id);
    if (!known)
      return {
          StatusCode::kBadValue, "view " + std::to_string (view.id) +
                                     " is not in the rig; give the camera host the same rig file"};
    if (Status s = check_view (view, *known); !s.ok ())
      return s;
  }
  return {};
}

/* ---- which streams make up frame sets ---- */

static Status
clash_of (const MuxStream &stream, const std::vector<MuxStream *> &chosen)
{
  const std::string name = GST_PAD_NAME (stream.pad);
  for (const MuxStream *other : chosen) {
    for (const View &view : stream.info.rig.views)
      if (other->info.rig.find (view.id))
        return {StatusCode::kBadValue,
            "pads " + std::string (GST_PAD_NAME (other->pad)) + " and " + name +
                " both have view-id " + std::to_string (view.id) +
                "; give each camera host another view-id, or set view-id-offset of a pad"};
    if (other->coded != stream.coded)
      return {StatusCode::kBadValue, "pads " + std::string (GST_PAD_NAME (other->pad)) + " and " +
                                         name + ": streams must be all raw or all coded"};
  }
  return {};
}

Status
choose_streams (const MuxStreams &streams, bool strict, gstrange::RangeInfo &info, GstCaps *&caps)
{
  std::vector<MuxStream *> order, chosen;
  for (const auto &stream : streams) {
    if (strict && !stream->other_rig.ok ())
      return {stream->other_rig.code (), stream->title () + ": " + stream->other_rig.message ()};
    stream->chosen = stream->chosen && stream->other_rig.ok ();
    if (stream->has_caps && stream->other_rig.ok ())
      order.push_back (stream.get ());
  }
  if (!strict)
    std::ranges::stable_sort (
        order, {}, [] (const MuxStream *stream) { return 2 * !stream->alive + !stream->chosen; });
  Rig united;
  for (MuxStream *stream : order) {
    stream->clash = clash_of (*stream, chosen);
    if (stream->clash.ok ())
      stream->clash = rangecast::merge (united, stream->info.rig);
    stream->chosen = stream->clash.ok ();
    if (stream->chosen)
      chosen.push_back (stream);
    else if (strict)
      return stream->clash;
  }
  if (chosen.empty ())
    return {};
  const MuxStream &first = *chosen.front ();
  info = gstrange::make_info (std::move (united), first.info.fps_n, first.info.fps_d);
  caps = first.coded ? gstrange::make_neighbour_code_caps (info) : gstrange::make_range_caps (info);
  return {};
}

/* ---- states, for users and applications ---- */

const char *
name_of (StreamState state)
{
  static constexpr const char *kNames[] = {
      "in", "silent", "late", "out-of-sync", "clash", "other-rig"};
  return kNames[int (state)];
}

/* The sentence that follows title(). */
static std::string
explain (const MuxStream &stream, StreamState state, GstClockTimeDiff offset)
{
  const std::string seconds = std::to_string (double (ABS (offset)) / GST_SECOND) + " s";
  switch (state) {
    case StreamState::kSilent:
      return ": nothing came for " + std::to_string (kSilentAfter / GST_SECOND) +
             " s; the others continue without it";
    case StreamState::kLate:
      return ": all buffers are late, capture times are " + seconds +
             " behind the others' and are dropped; check that the host and the network keep up, "
             "synchronise its clock, or raise latency";
    case StreamState::kOutOfSync:
      return ": its capture times are " + seconds + (offset < 0 ? " behind" : " ahead of") +
             " the others': the host's clock is not synchronised; ignored until it is";
    case StreamState::kOtherRig:
      return ": " + stream.other_rig.message () + "; ignored";
    case StreamState::kClash:
      return ": " + stream.clash.message () + "; ignored";
    default:
      return ": is back";
  }
}

void
report_state (GstElement *element, MuxStream &stream, StreamState state, GstClockTimeDiff offset)
{
  const int view_id = stream.has_caps ? stream.info.rig.views.front ().id : -1;
  stream.reported = state;
  const std::string text = stream.title () + explain (stream, state, offset);
  if (state != StreamState::kIn)
    gst_range_post_warning (element, {StatusCode::kBadData, text});
  gst_element_post_message (element,
      gst_message_new_element (GST_OBJECT (element),
          gst_structure_new ("rangemux-stream", "pad", G_TYPE_STRING, GST_PAD_NAME (stream.pad),
              "view-id", G_TYPE_INT, view_id, "state", G_TYPE_STRING, name_of (state), "offset",
              G_TYPE_INT64, gint64 (offset), nullptr)));
}
