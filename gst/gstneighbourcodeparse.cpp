/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodeparse
 * @title: neighbourcodeparse
 *
 * Turns files of coded frame sets into access units, and access units into the byte stream that
 * files hold: whichever downstream asks for. Goes on after damage at the next start code. Comes
 * with a typefinder.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=60 ! neighbourcodeenc ! neighbourcodeparse !
 * application/x-neighbour-code,alignment=byte-stream ! filesink location=head.rcnc gst-launch-1.0
 * filesrc location=head.rcnc ! neighbourcodeparse ! neighbourcodedec ! plyenc ! multifilesink
 * location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include "gstneighbourcodeparse.h"

#include <gst/base/base.h>

#include <algorithm>
#include <cstring>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangestatus.hpp>
#include <rangecast/neighbourcode/unit.hpp>
#include <span>
#include <vector>

using rangecast::AccessUnitHeader;
using rangecast::kAccessUnitHeaderSize;
using rangecast::kStartCode;
using rangecast::SliceHeader;
using rangecast::UnitHeader;
using rangecast::UnitReader;
using rangecast::UnitType;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_parse_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_parse_debug

using Bytes = std::span<const guint8>;

static constexpr gsize kPrefix = kStartCode.size () + kAccessUnitHeaderSize;
/* More data is asked for in such steps while the end of an access unit is not in sight. */
static constexpr guint kMore = 65536;
/* The rig is written again after so much time. */
static constexpr GstClockTime kRigInterval = GST_SECOND;

struct GstNeighbourCodeParsePrivate { /* streaming thread only */
  bool reads_stream = true;           /* sink: byte stream; else access units */
  bool writes_stream = false;         /* src: byte stream; else access units */
  bool src_caps_set = false;
  rangecast::RigCollector collector;
  unsigned used_generation = 0;
  GstClockTime first_pts = GST_CLOCK_TIME_NONE;
  guint64 frames = 0;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  std::vector<guint8> slices;

  gstrange::RangeInfo info; /* of access units to be written */
  std::vector<guint8> rig_units;
  GstClockTime last_rig = GST_CLOCK_TIME_NONE;
};

struct _GstNeighbourCodeParse {
  GstBaseParse parent;
  GstNeighbourCodeParsePrivate *priv;
};

#define STREAM_CAPS GST_NEIGHBOUR_CODE_STREAM_CAPS
#define ACCESS_UNIT_CAPS                                                                           \
  GST_NEIGHBOUR_CODE_MEDIA_TYPE                                                                    \
  ", version = (int) 1, alignment = (string) access-unit, " GST_RANGE_SIZE_CAPS_

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (STREAM_CAPS "; " ACCESS_UNIT_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (ACCESS_UNIT_CAPS "; " STREAM_CAPS));

G_DEFINE_TYPE (GstNeighbourCodeParse, gst_neighbour_code_parse, GST_TYPE_BASE_PARSE)

/* ---- what lies at the beginning of bytes ---- */

static bool
begins_access_unit (Bytes bytes, AccessUnitHeader &header)
{
  return bytes.size () >= kPrefix &&
         std::memcmp (bytes.data (), kStartCode.data (), kStartCode.size ()) == 0 &&
         rangecast::read_access_unit_header (
             bytes.subspan (kStartCode.size (), kAccessUnitHeaderSize), header)
             .ok ();
}

/* Where the next access unit begins, from `from` on; bytes.size () if none is in sight. Places too
 * near the end to tell count as candidates if `or_candidate`. */
static gsize
find_access_unit (Bytes bytes, gsize from, bool or_candidate)
{
  auto at = bytes.begin () + std::ptrdiff_t (std::min (from, bytes.size ()));
  while (true) {
    at = std::search (at, bytes.end (), kStartCode.begin (), kStartCode.end ());
    if (at == bytes.end ())
      break;
    const auto position = gsize (at - bytes.begin ());
    AccessUnitHeader header;
    const Bytes rest = bytes.subspan (position);
    if (begins_access_unit (rest, header) || (or_candidate && rest.size () < kPrefix))
      return position;
    ++at;
  }
  return bytes.size ();
}

static void
find_type (GstTypeFind *find, gpointer)
{
  const guint8 *data = gst_type_find_peek (find, 0, kPrefix);
  AccessUnitHeader header;
  if (!data || !begins_access_unit ({data, kPrefix}, header))
    return;
  GstCaps *caps = gst_caps_from_string (STREAM_CAPS);
  gst_type_find_suggest (find, GST_TYPE_FIND_MAXIMUM, caps);
  gst_caps_unref (caps);
}

static gboolean
register_with_typefinder (GstPlugin *plugin)
{
  GstCaps *caps = gst_caps_from_string (STREAM_CAPS);
  const gboolean typefinder = gst_type_find_register (plugin, "application/x-neighbour-code",
      GST_RANK_PRIMARY, find_type, "rcnc", caps, nullptr, nullptr);
  gst_caps_unref (caps);
  return typefinder && gst_element_register (plugin, "neighbourcodeparse", GST_RANK_PRIMARY + 1,
                           GST_TYPE_NEIGHBOUR_CODE_PARSE);
}

GST_ELEMENT_REGISTER_DEFINE_CUSTOM (neighbourcodeparse, register_with_typefinder)

/* ---- caps ---- */

/* Access units unless downstream takes only the byte stream. */
static bool
downstream_wants_stream (GstBaseParse *base)
{
  GstCaps *allowed = gst_pad_get_allowed_caps (GST_BASE_PARSE_SRC_PAD (base));
  GstCaps *access_units =
      gst_caps_from_string (GST_NEIGHBOUR_CODE_MEDIA_TYPE ", alignment = (string) access-unit");
  const bool wants =
      allowed && !gst_caps_is_empty (allowed) && !gst_caps_can_intersect (allowed, access_units);
  gst_clear_caps (&allowed);
  gst_caps_unref (access_units);
  return wants;
}

static void
set_source_caps (GstBaseParse *base, const gstrange::RangeInfo &info)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  priv->writes_stream = downstream_wants_stream (base);
  GstCaps *caps = gstrange::make_neighbour_code_caps (
      info, priv->writes_stream ? "byte-stream" : "access-unit");
  gst_pad_set_caps (GST_BASE_PARSE_SRC_PAD (base), caps);
  gst_caps_unref (caps);
  priv->duration = info.frame_duration ();
  if (info.fps_n > 0)
    gst_base_parse_set_frame_rate (base, guint (info.fps_n), guint (info.fps_d), 0, 0);
  priv->src_caps_set = true;
}

static gboolean
gst_neighbour_code_parse_set_sink_caps (GstBaseParse *base, GstCaps *caps)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const gchar *alignment = gst_structure_get_string (gst_caps_get_structure (caps, 0), "alignment");
  priv->reads_stream = g_strcmp0 (alignment, "access-unit") != 0;
  gst_base_parse_set_min_frame_size (base, priv->reads_stream ? guint (kPrefix) : 1);
  if (priv->reads_stream)
    return TRUE;
  const rangecast::Status status = gstrange::parse_caps (caps, priv->info);
  if (gst_range_flow_return (GST_ELEMENT (base), status) != GST_FLOW_OK)
    return FALSE;
  priv->rig_units.clear ();
  rangecast::write_rig_units (
      {priv->info.rig, priv->info.fps_n, priv->info.fps_d}, priv->rig_units);
  priv->last_rig = GST_CLOCK_TIME_NONE;
  set_source_caps (base, priv->info);
  return TRUE;
}

/* ---- from access units ---- */

static GstClockTime
capture_time_of (Bytes access_unit)
{
  UnitReader units (access_unit);
  UnitHeader header;
  SliceHeader slice;
  while (const auto unit = units.next (header))
    if (rangecast::read_slice_header (*unit, slice).ok ())
      return slice.capture_time_ns;
  return 0;
}

static bool
rig_is_due (GstNeighbourCodeParsePrivate *priv, GstClockTime pts)
{
  const bool due = !GST_CLOCK_TIME_IS_VALID (priv->last_rig) || !GST_CLOCK_TIME_IS_VALID (pts) ||
                   pts < priv->last_rig || pts - priv->last_rig >= kRigInterval;
  if (due)
    priv->last_rig = pts;
  return due;
}

/* Start code, header, the rig where it is due, and the access unit itself. */
static GstBuffer *
make_stream_buffer (GstNeighbourCodeParsePrivate *priv, Bytes access_unit, GstClockTime pts)
{
  const Bytes rig = rig_is_due (priv, pts) ? Bytes (priv->rig_units) : Bytes ();
  AccessUnitHeader header;
  header.size = guint32 (rig.size () + access_unit.size ());
  header.pts_ns = pts;
  header.capture_time_ns = capture_time_of (access_unit);
  guint8 prefix[kPrefix];
  std::copy (kStartCode.begin (), kStartCode.end (), prefix);
  rangecast::write_access_unit_header (header, prefix + kStartCode.size ());
  GstBuffer *buffer = gst_buffer_new_allocate (nullptr, kPrefix + header.size, nullptr);
  gsize offset = 0;
  for (const Bytes part : {Bytes (prefix), rig, access_unit})
    offset += gst_buffer_fill (buffer, offset, part.data (), part.size ());
  return buffer;
}

static GstFlowReturn
handle_access_unit (GstBaseParse *base, GstBaseParseFrame *frame)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  GstMapInfo map;
  const gsize size = gst_buffer_get_size (frame->buffer);
  if (priv->writes_stream && gst_buffer_map (frame->buffer, &map, GST_MAP_READ)) {
    frame->out_buffer =
        make_stream_buffer (priv, {map.data, map.size}, GST_BUFFER_PTS (frame->buffer));
    gst_buffer_unmap (frame->buffer, &map);
    gst_buffer_copy_into (frame->out_buffer, frame->buffer,
        GstBufferCopyFlags (GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS), 0, -1);
  }
  return gst_base_parse_finish_frame (base, frame, gint (size));
}

/* ---- from the byte stream ---- */

/* Length of the access unit at the beginning of `bytes`; 0: more bytes are needed to tell. */
static gsize
access_unit_length (Bytes bytes, const AccessUnitHeader &header, bool draining)
{
  const gsize told = kPrefix + header.size;
  const gsize next = find_access_unit (bytes, kPrefix, false);
  if (next < bytes.size ())
    return std::min (next, told); /* earlier than told: its size is damaged */
  if (draining)
    return std::min (bytes.size (), told);
  return bytes.size () >= told + kPrefix ? told : 0; /* rubbish follows */
}

/* Gathers rig and slices of one access unit. */
static void
take_units (GstBaseParse *base, Bytes units)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  priv->slices.clear ();
  UnitReader reader (units);
  UnitHeader header;
  while (const auto unit = reader.next (header)) {
    if (header.type != guint8 (UnitType::kRigView))
      priv->slices.insert (priv->slices.end (), unit->begin (), unit->end ());
    else if (!priv->collector.add (*unit).ok ())
      GST_DEBUG_OBJECT (base, "a damaged rig view");
  }
  if (priv->collector.generation () == priv->used_generation)
    return;
  priv->used_generation = priv->collector.generation ();
  const rangecast::StreamInfo &stream = priv->collector.info ();
  set_source_caps (base, gstrange::make_info (stream.rig, stream.fps_n, stream.fps_d));
}

/* Times of a file begin at 0. */
static GstClockTime
time_of (GstNeighbourCodeParsePrivate *priv, const AccessUnitHeader &header)
{
  if (!GST_CLOCK_TIME_IS_VALID (header.pts_ns))
    return GST_CLOCK_TIME_IS_VALID (priv->duration) ? priv->frames * priv->duration
                                                    : GST_CLOCK_TIME_NONE;
  if (!GST_CLOCK_TIME_IS_VALID (priv->first_pts))
    priv->first_pts = header.pts_ns;
  return header.pts_ns >= priv->first_pts ? header.pts_ns - priv->first_pts : 0;
}

static GstFlowReturn
finish_access_unit (
    GstBaseParse *base, GstBaseParseFrame *frame, const AccessUnitHeader &header, gsize length)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const GstClockTime pts = time_of (priv, header);
  priv->frames++;
  if (!priv->writes_stream)
    frame->out_buffer = gst_buffer_new_memdup (priv->slices.data (), priv->slices.size ());
  frame->buffer = gst_buffer_make_writable (frame->buffer);
  for (GstBuffer *buffer : {frame->buffer, frame->out_buffer}) {
    if (!buffer)
      continue;
    GST_BUFFER_PTS (buffer) = pts;
    GST_BUFFER_DURATION (buffer) = priv->duration;
    GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
    gst_range_buffer_set_capture_time (buffer, header.capture_time_ns);
  }
  return gst_base_parse_finish_frame (base, frame, gint (length));
}

static GstFlowReturn
handle_stream (GstBaseParse *base, GstBaseParseFrame *frame, gint *skip)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const bool draining = GST_BASE_PARSE_DRAINING (base);
  GstMapInfo map;
  if (!gst_buffer_map (frame->buffer, &map, GST_MAP_READ))
    return GST_FLOW_ERROR;
  const Bytes bytes (map.data, map.size);
  AccessUnitHeader header;
  gsize length = 0;
  *skip = 0;
  if (!begins_access_unit (bytes, header)) {
    *skip = gint (find_access_unit (bytes, 1, !draining));
    if (gsize (*skip) == bytes.size () && !draining) /* half a start code may be at its end */
      *skip -= gint (std::min (bytes.size () - 1, kStartCode.size () - 1));
  } else {
    length = access_unit_length (bytes, header, draining);
    if (length)
      take_units (base, bytes.subspan (kPrefix, length - kPrefix));
  }
  const gsize size = bytes.size ();
  gst_buffer_unmap (frame->buffer, &map);
  if (*skip > 0 || !length) {
    /* Nothing yet: come again with more, or behind what is no access unit. */
    gst_base_parse_set_min_frame_size (base, guint (*skip ? kPrefix : size + kMore));
    return GST_FLOW_OK;
  }
  gst_base_parse_set_min_frame_size (base, guint (kPrefix));
  if (!priv->src_caps_set || priv->slices.empty ()) { /* of no use without its rig, or empty */
    *skip = gint (length);
    return GST_FLOW_OK;
  }
  return finish_access_unit (base, frame, header, length);
}

static GstFlowReturn
gst_neighbour_code_parse_handle_frame (GstBaseParse *base, GstBaseParseFrame *frame, gint *skip)
{
  if (GST_NEIGHBOUR_CODE_PARSE (base)->priv->reads_stream)
    return handle_stream (base, frame, skip);
  return handle_access_unit (base, frame);
}

/* ---- life ---- */

static gboolean
gst_neighbour_code_parse_start (GstBaseParse *base)
{
  auto self = GST_NEIGHBOUR_CODE_PARSE (base);
  *self->priv = {};
  gst_base_parse_set_syncable (base, TRUE);
  gst_base_parse_set_min_frame_size (base, guint (kPrefix));
  return TRUE;
}

static void
gst_neighbour_code_parse_finalize (GObject *object)
{
  delete GST_NEIGHBOUR_CODE_PARSE (object)->priv;
  G_OBJECT_CLASS (gst_neighbour_code_parse_parent_class)->finalize (object);
}

static void
gst_neighbour_code_parse_init (GstNeighbourCodeParse *self)
{
  self->priv = new GstNeighbourCodeParsePrivate;
  GST_PAD_SET_ACCEPT_INTERSECT (GST_BASE_PARSE_SINK_PAD (self));
  GST_PAD_SET_ACCEPT_TEMPLATE (GST_BASE_PARSE_SINK_PAD (self));
}

static void
gst_neighbour_code_parse_class_init (GstNeighbourCodeParseClass *klass)
{
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto parse_class = GST_BASE_PARSE_CLASS (klass);

  G_OBJECT_CLASS (klass)->finalize = gst_neighbour_code_parse_finalize;
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Neighbour code parser",
      "Codec/Parser/Video", "Parses and writes files of coded range frame sets", "gst-rangecast");

  parse_class->start = gst_neighbour_code_parse_start;
  parse_class->set_sink_caps = gst_neighbour_code_parse_set_sink_caps;
  parse_class->handle_frame = gst_neighbour_code_parse_handle_frame;

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_parse_debug, "neighbourcodeparse", 0, "Neighbour code parser");
}
