/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodeparse
 * @title: neighbourcodeparse
 *
 * Divides coded frame sets that follow one another in any buffers, as in files, into access units,
 * and reads their rig for the caps. Parsing resumes at the next access unit after damage. Files can
 * be sought by time. Comes with a typefinder.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=head.rcnc ! neighbourcodeparse ! neighbourcodedec ! \
 *   rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
/* Locking: NeighbourCodeSeek has a lock of its own; all else belongs to the streaming thread. */
#include <gst/base/gstbaseparse.h>

#include <gst/base/base.h>

#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangestatus.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <span>
#include <utility>

#include "common/accessunitwriter.hpp"
#include "common/capsadvice.hpp"
#include "common/codedunits.hpp"
#include "common/elementproperties.hpp"
#include "seek.hpp"

using rangecast::AccessUnitHeader;
using rangecast::kAccessUnitHeaderSize;
using rangecast::SliceHeader;
using rangecast::StreamPart;
using rangecast::UnitHeader;
using rangecast::UnitReader;
using rangecast::UnitType;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_parse_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_parse_debug

namespace {

using Bytes = std::span<const guint8>;

/* Maximum bytes before the first access unit; a stream that begins with more is another type. */
constexpr gsize kMaxLeadingBytes = 2 << 20;

struct Stream {
  bool reads_stream = true; /* its buffers are not access units */
  bool src_caps_set = false;
  bool discont = false; /* bytes were dropped since the last buffer */
  bool in_sync = false; /* the last bytes were an access unit */
  bool warned_damage = false;
  bool found = false;                /* an access unit */
  gsize leading_bytes = 0;           /* before it */
  rangecast::RigCollector collector; /* of the byte stream */
  unsigned used_generation = 0;      /* of collector: the rig of the source caps */
  gstrange::RangeInfo info;          /* of the source caps */

  rangecast::KeyCheck key_check; /* of access units */
};

} // namespace

struct GstNeighbourCodeParsePrivate {
  NeighbourCodeSeek seek;
  Stream stream;
};

DECLARE_ELEMENT (
    GstNeighbourCodeParse, gst_neighbour_code_parse, NEIGHBOUR_CODE_PARSE, GstBaseParse)

G_DEFINE_TYPE (GstNeighbourCodeParse, gst_neighbour_code_parse, GST_TYPE_BASE_PARSE)

/* ---- typefinder ---- */

static void
find_type (GstTypeFind *find, gpointer)
{
  const guint8 *data = gst_type_find_peek (find, 0, kAccessUnitHeaderSize);
  AccessUnitHeader header;
  if (data && rangecast::begins_access_unit ({data, kAccessUnitHeaderSize}, header))
    gst_type_find_suggest_simple (find, GST_TYPE_FIND_MAXIMUM, GST_NEIGHBOUR_CODE_MEDIA_TYPE,
        "version", G_TYPE_INT, rangecast::kBitstreamVersion, nullptr);
}

static gboolean
register_with_typefinder (GstPlugin *plugin)
{
  GstCaps *caps = gst_caps_from_string (GST_NEIGHBOUR_CODE_STREAM_CAPS);
  const gboolean typefinder = gst_type_find_register (plugin, "video/x-neighbour-code",
      GST_RANK_PRIMARY, find_type, "rcnc", caps, nullptr, nullptr);
  gst_caps_unref (caps);
  return typefinder && gst_element_register (plugin, "neighbourcodeparse", GST_RANK_PRIMARY + 1,
                           gst_neighbour_code_parse_get_type ());
}

GST_ELEMENT_REGISTER_DEFINE_CUSTOM (neighbourcodeparse, register_with_typefinder)

/* ---- caps ---- */

/* After a frame or a discontinuity: requests no more than a header, until the size is known. */
static void
reset_min_frame_size (GstBaseParse *base)
{
  const Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  gst_base_parse_set_min_frame_size (base, stream.reads_stream ? guint (kAccessUnitHeaderSize) : 1);
}

static bool
any_parent_changes_state (GstBaseParse *base)
{
  bool changes = false;
  GstObject *parent = gst_object_get_parent (GST_OBJECT (base));
  while (parent && !changes) {
    changes = !GST_STATE_TRYLOCK (parent);
    if (!changes)
      GST_STATE_UNLOCK (parent);
    GstObject *next = gst_object_get_parent (parent);
    gst_object_unref (parent);
    parent = next;
  }
  gst_clear_object (&parent);
  return changes;
}

/* For 5 s at most: uridecodebin3 of GStreamer 1.22 starts its source before decodebin3, which loses
 * what comes before it is in PAUSED. */
static void
wait_for_state_change (GstBaseParse *base)
{
  for (int i = 0; i < 5000 && any_parent_changes_state (base) &&
                  !GST_PAD_IS_FLUSHING (GST_BASE_PARSE_SRC_PAD (base));
       i++)
    g_usleep (1000);
}

static bool
set_source_caps (GstBaseParse *base)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (!gst_pad_has_current_caps (GST_BASE_PARSE_SRC_PAD (base)))
    wait_for_state_change (base);
  stream.src_caps_set = false;
  if (!require_downstream (GST_ELEMENT (base), GST_BASE_PARSE_SRC_PAD (base), false))
    return false;
  GstCaps *caps = gstrange::make_neighbour_code_caps (stream.info);
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT, caps);
  stream.src_caps_set = gst_pad_set_caps (GST_BASE_PARSE_SRC_PAD (base), caps);
  gst_caps_unref (caps);
  gst_base_parse_set_frame_rate (base, guint (stream.info.fps_n), guint (stream.info.fps_d), 0, 0);
  GstTagList *tags = gst_tag_list_new (GST_TAG_VIDEO_CODEC, "Neighbour code", nullptr);
  gst_base_parse_merge_tags (base, tags, GST_TAG_MERGE_REPLACE);
  gst_tag_list_unref (tags);
  return stream.src_caps_set;
}

static gboolean
gst_neighbour_code_parse_set_sink_caps (GstBaseParse *base, GstCaps *caps)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  const gchar *alignment = gst_structure_get_string (gst_caps_get_structure (caps, 0), "alignment");
  stream.reads_stream = g_strcmp0 (alignment, "access-unit") != 0;
  reset_min_frame_size (base);
  if (stream.reads_stream)
    return TRUE;
  const rangecast::Status status = gstrange::parse_caps (caps, stream.info);
  return gst_range_flow_return (GST_ELEMENT (base), status) == GST_FLOW_OK &&
         set_source_caps (base);
}

/* ---- from access units ---- */

/* @return false if the buffer cannot be mapped */
static bool
add_slices (GstBuffer *access_unit, rangecast::KeyCheck &check)
{
  check.reset ();
  const auto handle = [&] (gsize, Bytes unit, const UnitHeader &) {
    SliceHeader slice;
    if (rangecast::read_slice_header (unit, slice).ok ())
      check.add (slice);
    return true;
  };
  rangecast::Status damage; /* what follows it is not read */
  return for_each_unit (access_unit, handle, damage);
}

static GstFlowReturn
refuse_unreadable_buffer (GstBaseParse *base)
{
  GST_ELEMENT_ERROR (base, RESOURCE, READ, (nullptr), ("cannot map an input buffer"));
  return GST_FLOW_ERROR;
}

/* The access unit with its buffer's time, which elements like capturesync leave alone in it; its
 * other bytes are shared. */
static GstBuffer *
with_time (GstBaseParse *base, GstBuffer *access_unit)
{
  AccessUnitHeader header;
  guint8 bytes[kAccessUnitHeaderSize];
  const GstClockTime time = byte_stream_time (base->segment, GST_BUFFER_PTS (access_unit));
  if (gst_buffer_extract (access_unit, 0, bytes, sizeof bytes) < sizeof bytes ||
      !rangecast::begins_access_unit (bytes, header) || header.pts_ns == time)
    return nullptr;
  header.pts_ns = time;
  rangecast::write_access_unit_header (header, bytes);
  GstBuffer *buffer = gst_buffer_copy_region (access_unit,
      GstBufferCopyFlags (
          GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS | GST_BUFFER_COPY_MEMORY),
      sizeof bytes, gsize (-1));
  GST_BUFFER_PTS (buffer) = GST_BUFFER_PTS (access_unit); /* not copied from an offset on */
  GST_BUFFER_DTS (buffer) = GST_BUFFER_DTS (access_unit);
  GST_BUFFER_DURATION (buffer) = GST_BUFFER_DURATION (access_unit);
  GstMemory *head = gst_allocator_alloc (nullptr, sizeof bytes, nullptr);
  gst_buffer_prepend_memory (buffer, head);
  gst_buffer_fill (buffer, 0, bytes, sizeof bytes);
  return buffer;
}

static GstFlowReturn
handle_access_unit (GstBaseParse *base, GstBaseParseFrame *frame)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (!add_slices (frame->buffer, stream.key_check))
    return refuse_unreadable_buffer (base);
  frame->buffer = gst_buffer_make_writable (frame->buffer);
  if (!stream.key_check.is_key ()) /* else upstream may know about lost packets */
    GST_BUFFER_FLAG_SET (frame->buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  frame->out_buffer = with_time (base, frame->buffer);
  return gst_base_parse_finish_frame (base, frame, gint (gst_buffer_get_size (frame->buffer)));
}

/* ---- from the byte stream ---- */

/* Drops bytes as frames instead of skipping them: the base class gives up after 2 MiB, and a
 * damaged access unit can be longer. */
static GstFlowReturn
drop (GstBaseParse *base, GstBaseParseFrame *frame, gsize size)
{
  GST_DEBUG_OBJECT (base, "dropping %" G_GSIZE_FORMAT " bytes at %" G_GUINT64_FORMAT, size,
      guint64 (frame->offset));
  GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream.discont = true;
  frame->flags |= GST_BASE_PARSE_FRAME_FLAG_DROP | GST_BASE_PARSE_FRAME_FLAG_NO_FRAME;
  return gst_base_parse_finish_frame (base, frame, gint (size));
}

/* Posts the first damage of a stream: bytes after an access unit that are not one, or the end
 * within one, as of a truncated recording. */
static void
warn_damage (GstBaseParse *base, const GstBaseParseFrame *frame, const StreamPart &part)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (!stream.in_sync || std::exchange (stream.warned_damage, true))
    return;
  const gsize got = part.length + part.garbage;
  if (part.expected)
    GST_ELEMENT_WARNING (base, STREAM, DECODE,
        ("The stream ends within the access unit at byte %" G_GUINT64_FORMAT
         ": needs %" G_GSIZE_FORMAT " bytes, got %" G_GSIZE_FORMAT,
            guint64 (frame->offset), part.expected, got),
        (nullptr));
  else
    GST_ELEMENT_WARNING (base, STREAM, DECODE,
        ("The stream is damaged: %" G_GSIZE_FORMAT " bytes at byte %" G_GUINT64_FORMAT
         " are not an access unit; further damage is only logged",
            got, guint64 (frame->offset)),
        (nullptr));
}

static GstFlowReturn
drop_garbage (GstBaseParse *base, GstBaseParseFrame *frame, const StreamPart &part)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  warn_damage (base, frame, part);
  stream.in_sync = false;
  stream.leading_bytes += part.garbage;
  if (!stream.found && stream.leading_bytes > kMaxLeadingBytes) {
    GST_ELEMENT_ERROR (base, STREAM, WRONG_TYPE,
        ("No access unit in the first 2 MiB: this is not a neighbour code byte stream"), (nullptr));
    return GST_FLOW_ERROR;
  }
  return drop (base, frame, part.garbage);
}

/* Adds the rig views of an access unit to the collector.
 * @return bytes of those that it begins with */
static gsize
collect_rig (GstBaseParse *base, Bytes units)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  UnitReader reader (units);
  UnitHeader header;
  gsize offset = 0, leading = 0;
  while (const auto unit = reader.next (header)) {
    const bool is_leading = leading == offset;
    offset += unit->size ();
    if (header.type != guint8 (UnitType::kRigView))
      continue;
    if (is_leading)
      leading = offset;
    const rangecast::Status status = stream.collector.add (*unit);
    if (status.code () == rangecast::StatusCode::kBadSize && !stream.src_caps_set &&
        !std::exchange (stream.warned_damage, true)) /* nothing can be decoded without the rig */
      gst_range_post_warning (GST_ELEMENT (base), status);
    if (!status.ok ())
      GST_DEBUG_OBJECT (base, "dropping a rig view: %s", status.message ().c_str ());
  }
  return leading;
}

/* Sets new caps if the rig has changed. */
static bool
update_caps (GstBaseParse *base)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (stream.collector.generation () == 0)
    return true;
  if (stream.collector.generation () == stream.used_generation && stream.src_caps_set)
    return true;
  stream.used_generation = stream.collector.generation ();
  const rangecast::StreamInfo &info = stream.collector.info ();
  stream.info = gstrange::make_info (info.rig, info.fps_n, info.fps_d);
  return set_source_caps (base);
}

/* The access unit; its memory is shared. */
static GstBuffer *
make_output (GstBaseParse *base, GstBuffer *input, const AccessUnitHeader &header, gsize length)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  GstBuffer *output = gst_buffer_copy_region (input,
      GstBufferCopyFlags (
          GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS | GST_BUFFER_COPY_MEMORY),
      0, length);
  GST_BUFFER_PTS (output) = GST_BUFFER_PTS (input);
  GST_BUFFER_DTS (output) = GST_BUFFER_DTS (input);
  GST_BUFFER_DURATION (output) = stream.info.frame_duration ();
  set_key (output, header.key);
  gst_range_buffer_set_capture_time (output, header.capture_time_ns);
  return output;
}

/* In a segment of time from upstream, the base class sets upstream's time instead. */
static void
set_time (GstBaseParse *base, const rangecast::AccessUnitPlace &place, GstBuffer *output)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const auto time = priv->seek.time_of (base, place, priv->stream.info.frame_duration ());
  GST_BUFFER_PTS (output) = GST_BUFFER_DTS (output) = time.time_ns;
  priv->stream.discont |= time.goes_back;
}

/* @param rig_size  bytes of the rig views that it begins with */
static GstFlowReturn
finish_access_unit (
    GstBaseParse *base, GstBaseParseFrame *frame, const StreamPart &part, gsize rig_size)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  const gsize units = kAccessUnitHeaderSize + rig_size;
  stream.in_sync = stream.found = true;
  reset_min_frame_size (base);
  if (!update_caps (base))
    return GST_PAD_IS_FLUSHING (GST_BASE_PARSE_SRC_PAD (base)) ? GST_FLOW_FLUSHING
                                                               : GST_FLOW_NOT_NEGOTIATED;
  if (stream.src_caps_set && part.expected)
    warn_damage (base, frame, part);
  if (!stream.src_caps_set || part.length <= units)
    return drop (base, frame, part.length);
  frame->out_buffer = make_output (base, frame->buffer, part.header, part.length);
  if (GST_CLOCK_TIME_IS_VALID (part.header.pts_ns)) /* else the base class interpolates */
    set_time (base, {guint64 (frame->offset), part.header, rig_size > 0}, frame->out_buffer);
  if (std::exchange (stream.discont, false))
    GST_BUFFER_FLAG_SET (frame->out_buffer, GST_BUFFER_FLAG_DISCONT);
  return gst_base_parse_finish_frame (base, frame, gint (part.length));
}

static GstFlowReturn
handle_stream (GstBaseParse *base, GstBaseParseFrame *frame)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  GstMapInfo map;
  if (!gst_buffer_map (frame->buffer, &map, GST_MAP_READ))
    return refuse_unreadable_buffer (base);
  const Bytes bytes (map.data, map.size);
  const StreamPart part = rangecast::next_part (bytes, GST_BASE_PARSE_DRAINING (base));
  gsize rig_size = 0;
  if (part.length)
    rig_size = collect_rig (base, bytes.first (part.length).subspan (kAccessUnitHeaderSize));
  gst_buffer_unmap (frame->buffer, &map);
  if (GST_BASE_PARSE_LOST_SYNC (base)) {
    priv->stream.in_sync = false;
    priv->seek.interrupt ();
  }
  if (part.garbage)
    return drop_garbage (base, frame, part);
  if (part.length)
    return finish_access_unit (base, frame, part, rig_size);
  gst_base_parse_set_min_frame_size (base, guint (part.wanted));
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_neighbour_code_parse_handle_frame (GstBaseParse *base, GstBaseParseFrame *frame, gint *skip)
{
  *skip = 0;
  if (GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream.reads_stream)
    return handle_stream (base, frame);
  return handle_access_unit (base, frame);
}

/* Access units before the segment are not clipped: those from the last key access unit on are
 * needed for decoding. Sinks clip them. */
static GstFlowReturn
gst_neighbour_code_parse_pre_push_frame (GstBaseParse *base, GstBaseParseFrame *frame)
{
  const GstClockTime pts = GST_BUFFER_PTS (frame->buffer);
  if (!GST_CLOCK_TIME_IS_VALID (pts) || pts >= base->segment.start)
    frame->flags |= GST_BASE_PARSE_FRAME_FLAG_CLIP;
  return GST_FLOW_OK;
}

/* ---- events ---- */

static gboolean
gst_neighbour_code_parse_src_event (GstBaseParse *base, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_SEEK)
    event = GST_NEIGHBOUR_CODE_PARSE (base)->priv->seek.handle_seek (base, event);
  if (!event)
    return FALSE;
  return GST_BASE_PARSE_CLASS (gst_neighbour_code_parse_parent_class)->src_event (base, event);
}

static gboolean
gst_neighbour_code_parse_sink_event (GstBaseParse *base, GstEvent *event)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const GstEventType type = GST_EVENT_TYPE (event);
  if (type == GST_EVENT_STREAM_START) {
    gst_base_parse_drain (base); /* the stream before */
    priv->stream.warned_damage = false;
    priv->seek.begin_stream ();
  }
  const gboolean done =
      GST_BASE_PARSE_CLASS (gst_neighbour_code_parse_parent_class)->sink_event (base, event);
  if (type == GST_EVENT_FLUSH_STOP || type == GST_EVENT_SEGMENT)
    reset_min_frame_size (base);
  return done;
}

/* ---- life ---- */

static gboolean
gst_neighbour_code_parse_reset (GstBaseParse *base)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  priv->stream = {};
  priv->seek.reset ();
  reset_min_frame_size (base);
  return TRUE;
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

  G_OBJECT_CLASS (klass)->finalize = delete_private<GstNeighbourCodeParse>;
  add_always_pads (element_class, GST_NEIGHBOUR_CODE_STREAM_CAPS, GST_NEIGHBOUR_CODE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Neighbour code parser",
      "Codec/Parser/Converter/Video", "Divides neighbour code byte streams into access units",
      "gst-rangecast");

  parse_class->start = parse_class->stop = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_reset);
  parse_class->set_sink_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_set_sink_caps);
  parse_class->sink_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_sink_event);
  parse_class->src_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_src_event);
  parse_class->handle_frame = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_handle_frame);
  parse_class->pre_push_frame = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_pre_push_frame);

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_parse_debug, "neighbourcodeparse", 0, "Neighbour code parser");
}
