/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodeparse
 * @title: neighbourcodeparse
 *
 * Converts between the byte stream of coded frame sets, as in files, and access units, as
 * downstream requires. Where downstream takes anything, as filesink does, the output is what the
 * input is not. Parsing resumes at the next start code after damage. Files can be sought by time.
 * Comes with a typefinder.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 udpsrc port=5100
 * caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE" !
 * rtpneighbourcodedepay ! neighbourcodeparse ! filesink location=head.rcnc
 * ]|
 * Writes a file.
 * |[
 * gst-launch-1.0 filesrc location=head.rcnc ! neighbourcodeparse ! neighbourcodedec !
 * rangealign ! striprender ! glimagesink
 * ]|
 * Plays it.
 *
 * Since: 0.1
 */
/* Locking: NeighbourCodeSeek has a lock of its own. Messages are posted in any thread: what they
 * depend on is atomic. */
#include "gstneighbourcodeparse.h"

#include <gst/base/base.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangestatus.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <span>
#include <utility>
#include <vector>

#include "common/capsadvice.hpp"
#include "common/codedunits.hpp"
#include "seek.hpp"
#include "streamprefixes.hpp"

using rangecast::AccessUnitHeader;
using rangecast::kStreamPrefixSize;
using rangecast::SliceHeader;
using rangecast::StreamPart;
using rangecast::UnitHeader;
using rangecast::UnitReader;
using rangecast::UnitType;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_parse_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_parse_debug

namespace {

using Bytes = std::span<const guint8>;

/* Maximum bytes in front of the first access unit; a stream that begins with more is another type.
 */
constexpr gsize kMaxLeadingRubbish = 2 << 20;

/* The typefinder looks for an access unit in so many bytes. If it is not at their beginning, H.264
 * and MPEG, which find start codes of theirs in the rest of an access unit, are less likely, but an
 * archive that holds a recording is more likely. */
constexpr guint kTypefindBytes = 65536;
constexpr auto kProbabilityOfCutStream = GstTypeFindProbability (GST_TYPE_FIND_LIKELY - 1);

/* What was found in the stream so far; selects the error text at its end. */
enum class Seen { kNothing, kBytes, kUnit, kAccessUnit, kRig, kSlices };

/* Some bytes of the input. */
struct Range {
  gsize offset, size;
};

struct Stream {               /* streaming thread only */
  bool reads_stream = true;   /* sink: byte stream; else access units */
  bool writes_stream = false; /* src: byte stream; else access units */
  bool src_caps_set = false;
  bool had_gaps = false;
  bool discont = false; /* bytes were dropped since the last buffer */
  bool ending = false;  /* push mode: EOS has arrived */
  bool in_sync = false; /* the last bytes were an access unit */
  bool flushed = false; /* since the last segment */
  bool is_new = false;  /* since the last segment another stream has begun */
  bool has_rig = false; /* the current access unit begins with rig views */
  bool warned_damage = false;
  gsize leading_rubbish = 0;
  rangecast::RigCollector collector; /* of the byte stream */
  std::string too_large;             /* why a rig was refused */
  unsigned used_generation = 0;      /* of collector: the rig of the source caps */
  gstrange::RangeInfo info;          /* of the source caps */
  std::vector<Range> output;         /* units of the current access unit but rig views */

  rangecast::KeyCheck key_check;
  StreamPrefixes prefixes; /* from access units */
};

} // namespace

struct GstNeighbourCodeParsePrivate {
  NeighbourCodeSeek seek;
  Stream stream;
  std::atomic<Seen> seen = Seen::kNothing; /* written by the streaming thread */
  std::atomic<bool> failed = false;        /* an error was posted since start or flush */
};

struct _GstNeighbourCodeParse {
  GstBaseParse parent;
  GstNeighbourCodeParsePrivate *priv;
};

#define STREAM_CAPS GST_NEIGHBOUR_CODE_STREAM_CAPS
#define ACCESS_UNIT_CAPS                                                                           \
  GST_NEIGHBOUR_CODE_MEDIA_TYPE                                                                    \
  ", version = (int) 3, alignment = (string) access-unit, " GST_RANGE_SIZE_CAPS_

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (STREAM_CAPS "; " ACCESS_UNIT_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (ACCESS_UNIT_CAPS "; " STREAM_CAPS));

G_DEFINE_TYPE (GstNeighbourCodeParse, gst_neighbour_code_parse, GST_TYPE_BASE_PARSE)

/* ---- typefinder ---- */

/* Whether an access unit begins here, up to the header of its first unit. */
static bool
begins_stream (Bytes bytes)
{
  AccessUnitHeader header;
  UnitHeader unit;
  if (bytes.size () < kStreamPrefixSize + rangecast::kUnitHeaderSize ||
      !rangecast::begins_access_unit (bytes, header))
    return false;
  (void)rangecast::read_unit_header (
      bytes.subspan (kStreamPrefixSize), unit); /* kTruncated, but the header is read */
  const bool is_known =
      unit.type == guint8 (UnitType::kSlice) || unit.type == guint8 (UnitType::kRigView);
  return is_known && unit.version == rangecast::kBitstreamVersion && unit.size <= header.size;
}

/* Where a stream was cut: an access unit within the first bytes, which any other type that is sure
 * of itself overrules. */
static bool
has_access_unit (GstTypeFind *find)
{
  const guint64 length = gst_type_find_get_length (find); /* 0 = unknown */
  guint size = kTypefindBytes;
  if (length > 0)
    size = guint (std::min<guint64> (size, length));
  const guint8 *data = nullptr;
  while (size >= kStreamPrefixSize && !(data = gst_type_find_peek (find, 0, size)))
    size /= 2;
  const auto end = data + (data ? size : 0);
  for (auto at = data; at != end; ++at) {
    at = std::search (at, end, rangecast::kStartCode.begin (), rangecast::kStartCode.end ());
    if (at == end)
      break;
    if (begins_stream ({at, end}))
      return true;
  }
  return false;
}

static void
find_type (GstTypeFind *find, gpointer)
{
  const guint8 *data = gst_type_find_peek (find, 0, kStreamPrefixSize);
  AccessUnitHeader header;
  const bool is_at_start =
      data && rangecast::begins_access_unit ({data, kStreamPrefixSize}, header);
  if (!is_at_start && !has_access_unit (find))
    return;
  GstCaps *caps = gst_caps_from_string (STREAM_CAPS);
  gst_type_find_suggest (find, is_at_start ? GST_TYPE_FIND_MAXIMUM : kProbabilityOfCutStream, caps);
  gst_caps_unref (caps);
}

static gboolean
register_with_typefinder (GstPlugin *plugin)
{
  GstCaps *caps = gst_caps_from_string (STREAM_CAPS);
  const gboolean typefinder = gst_type_find_register (plugin, "video/x-neighbour-code",
      GST_RANK_PRIMARY, find_type, "rcnc", caps, nullptr, nullptr);
  gst_caps_unref (caps);
  return typefinder && gst_element_register (plugin, "neighbourcodeparse", GST_RANK_PRIMARY + 1,
                           GST_TYPE_NEIGHBOUR_CODE_PARSE);
}

GST_ELEMENT_REGISTER_DEFINE_CUSTOM (neighbourcodeparse, register_with_typefinder)

/* ---- caps ---- */

/* After a frame or a discontinuity: requests no more than a header, until the size is known. */
static void
reset_min_frame_size (GstBaseParse *base)
{
  const Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  gst_base_parse_set_min_frame_size (base, stream.reads_stream ? guint (kStreamPrefixSize) : 1);
}

static bool
set_source_caps (GstBaseParse *base)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  stream.src_caps_set = false;
  if (!require_downstream (GST_ELEMENT (base), GST_BASE_PARSE_SRC_PAD (base), false))
    return false;
  gst_pad_check_reconfigure (GST_BASE_PARSE_SRC_PAD (base)); /* clears the flag */
  /* Decoders that decodebin plugs later take access units. */
  const char *alignment = preferred_alignment (
      GST_BASE_PARSE_SRC_PAD (base), stream.reads_stream ? "access-unit" : "byte-stream");
  stream.writes_stream = g_str_equal (alignment, "byte-stream");
  GstCaps *caps = gstrange::make_neighbour_code_caps (stream.info, alignment);
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT, caps);
  stream.src_caps_set = gst_pad_set_caps (GST_BASE_PARSE_SRC_PAD (base), caps);
  gst_caps_unref (caps);
  gst_base_parse_set_frame_rate (base, guint (stream.info.fps_n), guint (stream.info.fps_d), 0, 0);
  GstTagList *tags = gst_tag_list_new (GST_TAG_VIDEO_CODEC, "Neighbour code", nullptr);
  gst_base_parse_merge_tags (base, tags, GST_TAG_MERGE_REPLACE);
  gst_tag_list_unref (tags);
  return stream.src_caps_set;
}

/* Flow return after downstream has refused the caps. */
static GstFlowReturn
caps_refused_flow (GstBaseParse *base)
{
  return GST_PAD_IS_FLUSHING (GST_BASE_PARSE_SRC_PAD (base)) ? GST_FLOW_FLUSHING
                                                             : GST_FLOW_NOT_NEGOTIATED;
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
  if (gst_range_flow_return (GST_ELEMENT (base), status) != GST_FLOW_OK)
    return FALSE;
  stream.prefixes.set_rig (stream.info);
  return set_source_caps (base);
}

/* ---- errors ---- */

static constexpr const char *kNoAccessUnit =
    "No access unit found: expected a neighbour code byte stream of version 3, which begins with "
    "the start code 00 52 43 55";

static std::string
missing_data_text (const GstNeighbourCodeParsePrivate *priv)
{
  switch (priv->seen) {
    case Seen::kNothing:
      return "No data arrived: expected a neighbour code byte stream";
    case Seen::kBytes:
      return kNoAccessUnit;
    case Seen::kUnit:
      return std::string (kNoAccessUnit) +
             "; these are access units without it: written without neighbourcodeparse before "
             "filesink?";
    case Seen::kAccessUnit:
      if (!priv->stream.too_large.empty ())
        return "The rig is too large: " + priv->stream.too_large;
      return "No complete rig found: expected the rig views of a neighbour code byte stream in "
             "front of its slices";
    default:
      return "The neighbour code byte stream ends before its first whole slice";
  }
}

static void
post_missing_data (GstBaseParse *base)
{
  const std::string text = missing_data_text (GST_NEIGHBOUR_CODE_PARSE (base)->priv);
  GST_ELEMENT_ERROR (base, STREAM, WRONG_TYPE, ("%s", text.c_str ()), (nullptr));
}

/* Replaces the base class's text "No valid frames found" by what is missing. */
static GstMessage *
replace_error_text (GstElement *element, GstMessage *message)
{
  GError *error = nullptr;
  gchar *debug = nullptr;
  const GstStructure *details = nullptr;
  gst_message_parse_error (message, &error, &debug);
  gst_message_parse_error_details (message, &details);
  if (g_error_matches (error, GST_STREAM_ERROR, GST_STREAM_ERROR_WRONG_TYPE)) {
    g_free (error->message);
    error->message =
        g_strdup (missing_data_text (GST_NEIGHBOUR_CODE_PARSE (element)->priv).c_str ());
    GstMessage *replaced = gst_message_new_error_with_details (
        GST_MESSAGE_SRC (message), error, debug, details ? gst_structure_copy (details) : nullptr);
    gst_message_set_seqnum (replaced, gst_message_get_seqnum (message));
    gst_message_unref (message);
    message = replaced;
  }
  g_clear_error (&error);
  g_free (debug);
  return message;
}

/* In pull mode the base class posts "Internal data stream error" after any other error: only the
 * first error is posted. */
static gboolean
gst_neighbour_code_parse_post_message (GstElement *element, GstMessage *message)
{
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR) {
    if (GST_NEIGHBOUR_CODE_PARSE (element)->priv->failed.exchange (true)) {
      gst_message_unref (message);
      return TRUE;
    }
    message = replace_error_text (element, message);
  }
  return GST_ELEMENT_CLASS (gst_neighbour_code_parse_parent_class)->post_message (element, message);
}

/* After a flush errors are posted again. A probe of the source pad sees both the flushes from
 * upstream and those of seeks in files, and no data flow meanwhile. */
static GstPadProbeReturn
handle_flush (GstPad *, GstPadProbeInfo *info, gpointer data)
{
  if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_FLUSH_STOP)
    static_cast<GstNeighbourCodeParsePrivate *> (data)->failed = false;
  return GST_PAD_PROBE_OK;
}

/* ---- from access units ---- */

/* Fills capture time and key of the access unit's header from its slices. @return false if the
 * buffer cannot be mapped */
static bool
summarise (GstBuffer *access_unit, rangecast::KeyCheck &check, AccessUnitHeader &summary)
{
  bool first = true;
  check.reset ();
  const auto handle = [&] (gsize, Bytes unit, const UnitHeader &) {
    SliceHeader slice;
    if (!rangecast::read_slice_header (unit, slice).ok ())
      return true;
    if (first)
      summary.capture_time_ns = slice.capture_time_ns;
    check.add (slice);
    first = false;
    return true;
  };
  rangecast::Status damage; /* what follows it is not read */
  const bool mapped = for_each_unit (access_unit, handle, damage);
  summary.key = check.is_key ();
  return mapped;
}

static void
set_key (GstBuffer *buffer, bool key)
{
  if (key)
    GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  else
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}

/* The access unit in the byte stream; its own bytes are shared, not copied. */
static GstBuffer *
make_stream_buffer (GstBaseParse *base, GstBuffer *access_unit, const AccessUnitHeader &header)
{
  StreamPrefixes &prefixes = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream.prefixes;
  GstBuffer *buffer = gst_buffer_copy_region (access_unit,
      GstBufferCopyFlags (
          GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS | GST_BUFFER_COPY_MEMORY),
      0, gst_buffer_get_size (access_unit));
  const GstClockTime time = byte_stream_time (base->segment, GST_BUFFER_PTS (access_unit));
  gst_buffer_prepend_memory (
      buffer, prefixes.make (header, time, gst_buffer_get_size (access_unit)));
  return buffer;
}

static GstFlowReturn
refuse_long_access_unit (GstBaseParse *base, gsize size)
{
  GST_ELEMENT_ERROR (base, STREAM, FORMAT,
      ("An access unit of %" G_GSIZE_FORMAT " bytes: expected at most 32 MiB with its rig", size),
      (nullptr));
  return GST_FLOW_ERROR;
}

static GstFlowReturn
refuse_unreadable_buffer (GstBaseParse *base)
{
  GST_ELEMENT_ERROR (base, RESOURCE, READ, (nullptr), ("cannot map an input buffer"));
  return GST_FLOW_ERROR;
}

static GstFlowReturn
handle_access_unit (GstBaseParse *base, GstBaseParseFrame *frame)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  const gsize size = gst_buffer_get_size (frame->buffer);
  if (gst_pad_check_reconfigure (GST_BASE_PARSE_SRC_PAD (base)) && !set_source_caps (base))
    return caps_refused_flow (base);
  if (size > stream.prefixes.max_access_unit ())
    return refuse_long_access_unit (base, size);
  AccessUnitHeader header;
  if (!summarise (frame->buffer, stream.key_check, header))
    return refuse_unreadable_buffer (base);
  /* Upstream may know about lost packets. */
  header.key = header.key && !GST_BUFFER_FLAG_IS_SET (frame->buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  frame->buffer = gst_buffer_make_writable (frame->buffer);
  set_key (frame->buffer, header.key);
  if (stream.writes_stream)
    frame->out_buffer = make_stream_buffer (base, frame->buffer, header);
  return gst_base_parse_finish_frame (base, frame, gint (size));
}

/* ---- from the byte stream ---- */

static GstFlowReturn
drop (GstBaseParse *base, GstBaseParseFrame *frame, gsize size)
{
  GST_DEBUG_OBJECT (base, "dropping %" G_GSIZE_FORMAT " bytes", size);
  GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream.discont = true;
  frame->flags |= GST_BASE_PARSE_FRAME_FLAG_DROP;
  return gst_base_parse_finish_frame (base, frame, gint (size));
}

/* What a stream begins with. A slice or rig view in front of any access unit is a hint only. */
static Seen
first_seen (Bytes bytes)
{
  UnitHeader unit;
  (void)rangecast::read_unit_header (bytes, unit); /* kTruncated, but the header is read */
  const bool is_known =
      unit.type == guint8 (UnitType::kSlice) || unit.type == guint8 (UnitType::kRigView);
  const bool is_unit = is_known && unit.version == rangecast::kBitstreamVersion && unit.flags < 8 &&
                       unit.size >= rangecast::kSliceHeaderSize;
  return is_unit ? Seen::kUnit : Seen::kBytes;
}

/* Posts the first damage of a stream: bytes after an access unit, neither after a seek nor at the
 * end, which warn_if_truncated() reports. */
static void
warn_damage (GstBaseParse *base, const GstBaseParseFrame *frame, const StreamPart &part)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (!std::exchange (stream.in_sync, false) || part.expected || stream.warned_damage)
    return;
  stream.warned_damage = true;
  GST_ELEMENT_WARNING (base, STREAM, DECODE,
      ("The stream is damaged: %" G_GSIZE_FORMAT " bytes at byte %" G_GUINT64_FORMAT
       " are not an access unit; further damage is only logged",
          part.rubbish, guint64 (frame->offset)),
      (nullptr));
}

/* Drops frames instead of skipping bytes, because the base class gives up after 2 MiB, and a
 * damaged access unit can be longer. */
static GstFlowReturn
drop_rubbish (GstBaseParse *base, GstBaseParseFrame *frame, gsize size)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  GST_WARNING_OBJECT (base,
      "%" G_GSIZE_FORMAT " bytes at %" G_GUINT64_FORMAT " are not an access unit", size,
      guint64 (frame->offset));
  if (priv->seen < Seen::kAccessUnit) {
    priv->stream.leading_rubbish += size;
    if (priv->stream.leading_rubbish > kMaxLeadingRubbish) {
      post_missing_data (base);
      return GST_FLOW_ERROR;
    }
  }
  return drop (base, frame, size);
}

static void
add_rig_view (GstBaseParse *base, Bytes unit)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  const rangecast::Status status = stream.collector.add (unit);
  if (status.code () == rangecast::StatusCode::kBadSize)
    stream.too_large = status.message ();
  if (!status.ok ())
    GST_DEBUG_OBJECT (base, "dropping a rig view: %s", status.message ().c_str ());
}

/* After a seek: the last rig of the file before the target. */
static void
use_rig_of_seek (GstBaseParse *base, guint64 offset)
{
  const std::vector<guint8> units = GST_NEIGHBOUR_CODE_PARSE (base)->priv->seek.rig_at (offset);
  UnitReader reader (units);
  UnitHeader header;
  while (const auto unit = reader.next (header))
    if (header.type == guint8 (UnitType::kRigView))
      add_rig_view (base, *unit);
}

/* Collects the rig of an access unit, and records where its other units are. */
static void
handle_units (GstBaseParse *base, Bytes units)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  stream.output.clear ();
  stream.has_rig = false;
  UnitReader reader (units);
  UnitHeader header;
  gsize offset = kStreamPrefixSize;
  while (const auto unit = reader.next (header)) {
    const bool is_rig_view = header.type == guint8 (UnitType::kRigView);
    stream.has_rig |= is_rig_view && offset == kStreamPrefixSize;
    if (is_rig_view)
      add_rig_view (base, *unit);
    else if (!stream.output.empty () &&
             stream.output.back ().offset + stream.output.back ().size == offset)
      stream.output.back ().size += unit->size ();
    else
      stream.output.push_back ({offset, unit->size ()});
    offset += unit->size ();
  }
}

/* Sets new caps if the rig has changed, or downstream reconfigures. */
static bool
update_caps (GstBaseParse *base)
{
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  const bool wanted = gst_pad_check_reconfigure (GST_BASE_PARSE_SRC_PAD (base));
  if (stream.collector.generation () == 0)
    return true;
  if (stream.collector.generation () == stream.used_generation && stream.src_caps_set && !wanted)
    return true;
  stream.used_generation = stream.collector.generation ();
  const rangecast::StreamInfo &info = stream.collector.info ();
  stream.info = gstrange::make_info (info.rig, info.fps_n, info.fps_d);
  return set_source_caps (base);
}

static GstMemory *
copy_ranges (GstBuffer *input, const std::vector<Range> &ranges)
{
  gsize size = 0;
  for (const Range &range : ranges)
    size += range.size;
  GstMemory *memory = gst_allocator_alloc (nullptr, size, nullptr);
  GstMapInfo from, to;
  if (gst_memory_map (memory, &to, GST_MAP_WRITE)) {
    guint8 *end = to.data;
    if (gst_buffer_map (input, &from, GST_MAP_READ)) {
      for (const Range &range : ranges)
        end = std::copy_n (from.data + range.offset, range.size, end);
      gst_buffer_unmap (input, &from);
    }
    gst_memory_unmap (memory, &to);
  }
  return memory;
}

/* The units of the output share the input's memory, unless they are more pieces than a buffer has
 * memories: GStreamer would copy all memories with each further one. */
static GstBuffer *
make_output (Stream &stream, GstBuffer *input, gsize length)
{
  if (stream.writes_stream)
    stream.output.assign (1, {0, length});
  GstBuffer *output = gst_buffer_new ();
  gst_buffer_copy_into (output, input, GST_BUFFER_COPY_FLAGS, 0, gsize (-1));
  if (stream.output.size () * gst_buffer_n_memory (input) > gst_buffer_get_max_memory ())
    gst_buffer_append_memory (output, copy_ranges (input, stream.output));
  else
    for (const Range &range : stream.output)
      gst_buffer_copy_into (output, input, GST_BUFFER_COPY_MEMORY, range.offset, range.size);
  GST_BUFFER_PTS (output) = GST_BUFFER_PTS (input);
  GST_BUFFER_DTS (output) = GST_BUFFER_DTS (input);
  return output;
}

/* In a segment of time from upstream, the base class sets upstream's time instead. */
static void
set_time (GstBaseParse *base, const GstBaseParseFrame *frame, const AccessUnitHeader &header,
    GstBuffer *output)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  Stream &stream = priv->stream;
  const rangecast::TakeList::Time time = priv->seek.time_of (
      base, {guint64 (frame->offset), header, stream.has_rig}, stream.info.frame_duration ());
  GST_BUFFER_PTS (output) = GST_BUFFER_DTS (output) = time.time_ns;
  if (time.begins_take) {
    GST_DEBUG_OBJECT (base,
        "a take begins at byte %" G_GUINT64_FORMAT ": %" GST_TIME_FORMAT
        " in the file is %" GST_TIME_FORMAT,
        guint64 (frame->offset), GST_TIME_ARGS (header.pts_ns), GST_TIME_ARGS (time.time_ns));
    stream.discont = true;
  }
}

static GstFlowReturn
finish_access_unit (
    GstBaseParse *base, GstBaseParseFrame *frame, const AccessUnitHeader &header, gsize length)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  Stream &stream = priv->stream;
  GstBuffer *output = make_output (stream, frame->buffer, length);
  if (GST_CLOCK_TIME_IS_VALID (header.pts_ns)) /* else the base class interpolates */
    set_time (base, frame, header, output);
  GST_BUFFER_DURATION (output) = stream.info.frame_duration ();
  set_key (output, header.key);
  if (stream.discont)
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  gst_range_buffer_set_capture_time (output, header.capture_time_ns);
  stream.discont = false;
  priv->seen = Seen::kSlices;
  frame->out_buffer = output;
  return gst_base_parse_finish_frame (base, frame, gint (length));
}

/* Of a truncated recording, the whole units of the last access unit are still output. */
static void
warn_if_truncated (GstBaseParse *base, const GstBaseParseFrame *frame, const StreamPart &part)
{
  const Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (!part.expected || !(NeighbourCodeSeek::reads_file (base) || stream.ending))
    return;
  const auto offset = guint64 (frame->offset);
  const gsize got = part.length + part.rubbish;
  GST_ELEMENT_WARNING (base, STREAM, DECODE,
      ("The stream ends at byte %" G_GUINT64_FORMAT
       ", within the access unit%s at byte %" G_GUINT64_FORMAT ": expected %" G_GSIZE_FORMAT
       " bytes, got %" G_GSIZE_FORMAT,
          offset + got, part.rubbish ? " header" : "", offset, part.expected, got),
      (nullptr));
}

static GstFlowReturn
handle_access_unit_of_stream (GstBaseParse *base, GstBaseParseFrame *frame, const StreamPart &part)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  Stream &stream = priv->stream;
  stream.in_sync = true;
  reset_min_frame_size (base);
  if (!update_caps (base))
    return caps_refused_flow (base);
  priv->seen = std::max (priv->seen.load (), stream.src_caps_set ? Seen::kRig : Seen::kAccessUnit);
  const bool passes = stream.src_caps_set && !stream.output.empty ();
  if (passes || priv->seen == Seen::kSlices) /* else the end of the stream is an error */
    warn_if_truncated (base, frame, part);
  return passes ? finish_access_unit (base, frame, part.header, part.length)
                : drop (base, frame, part.length);
}

static GstFlowReturn
handle_stream (GstBaseParse *base, GstBaseParseFrame *frame)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  GstMapInfo map;
  if (!gst_buffer_map (frame->buffer, &map, GST_MAP_READ))
    return refuse_unreadable_buffer (base);
  const Bytes bytes (map.data, map.size);
  if (priv->seen == Seen::kNothing)
    priv->seen = first_seen (bytes);
  const StreamPart part = rangecast::next_part (bytes, GST_BASE_PARSE_DRAINING (base));
  if (part.length) {
    use_rig_of_seek (base, guint64 (frame->offset));
    handle_units (base, bytes.subspan (kStreamPrefixSize, part.length - kStreamPrefixSize));
  }
  gst_buffer_unmap (frame->buffer, &map);
  if (GST_BASE_PARSE_LOST_SYNC (base)) {
    priv->stream.in_sync = false;
    priv->seek.interrupt ();
  }
  if (part.rubbish) {
    if (priv->seen == Seen::kSlices)
      warn_if_truncated (base, frame, part);
    warn_damage (base, frame, part);
    return drop_rubbish (base, frame, part.rubbish);
  }
  if (part.length)
    return handle_access_unit_of_stream (base, frame, part);
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
  if (GST_EVENT_TYPE (event) == GST_EVENT_SEEK && NeighbourCodeSeek::reads_file (base))
    event = GST_NEIGHBOUR_CODE_PARSE (base)->priv->seek.handle_seek (base, event);
  if (!event)
    return FALSE;
  return GST_BASE_PARSE_CLASS (gst_neighbour_code_parse_parent_class)->src_event (base, event);
}

/* An empty file. Where nothing has arrived otherwise, as from a network, it is not an error here.
 */
static bool
upstream_is_empty (GstBaseParse *base)
{
  gint64 size = -1;
  return gst_pad_peer_query_duration (GST_BASE_PARSE_SINK_PAD (base), GST_FORMAT_BYTES, &size) &&
         size == 0;
}

static void
finish_stream (GstBaseParse *base)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  priv->stream.ending = true;
  if (base->segment.rate > 0)
    gst_base_parse_drain (base);
  priv->stream.ending = false;
  if (!priv->stream.reads_stream || priv->seen == Seen::kSlices || priv->stream.had_gaps)
    return;
  if (priv->seen != Seen::kNothing || upstream_is_empty (base))
    post_missing_data (base);
}

/* The rig is written again with the key access unit that the event announces, if it asks for
 * headers. */
static void
handle_key_unit_event (GstBaseParse *base, GstEvent *event)
{
  gboolean all_headers = FALSE;
  if (gst_video_event_is_force_key_unit (event) &&
      gst_video_event_parse_downstream_force_key_unit (
          event, nullptr, nullptr, nullptr, &all_headers, nullptr) &&
      all_headers)
    GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream.prefixes.repeat_rig ();
}

/* The base class drains the stream before at the next stream's segment, and counts bytes anew. */
static void
begin_segment (GstBaseParse *base)
{
  GstNeighbourCodeParsePrivate *priv = GST_NEIGHBOUR_CODE_PARSE (base)->priv;
  const bool flushed = std::exchange (priv->stream.flushed, false);
  if (std::exchange (priv->stream.is_new, false))
    priv->seek.begin_stream (flushed);
}

static gboolean
gst_neighbour_code_parse_sink_event (GstBaseParse *base, GstEvent *event)
{
  const GstEventType type = GST_EVENT_TYPE (event);
  handle_key_unit_event (base, event);
  Stream &stream = GST_NEIGHBOUR_CODE_PARSE (base)->priv->stream;
  if (type == GST_EVENT_EOS)
    finish_stream (base);
  else if (type == GST_EVENT_GAP)
    stream.had_gaps = true;
  else if (type == GST_EVENT_STREAM_START) {
    stream.warned_damage = false;
    stream.is_new = true;
  } else if (type == GST_EVENT_FLUSH_STOP)
    stream.flushed = true;
  const gboolean done =
      GST_BASE_PARSE_CLASS (gst_neighbour_code_parse_parent_class)->sink_event (base, event);
  if (type == GST_EVENT_SEGMENT)
    begin_segment (base);
  if (type == GST_EVENT_FLUSH_STOP || type == GST_EVENT_SEGMENT)
    reset_min_frame_size (base);
  return done;
}

/* ---- life ---- */

static void
reset_stream (GstNeighbourCodeParsePrivate *priv)
{
  priv->stream = {};
  priv->seek.reset ();
  priv->seen = Seen::kNothing;
  priv->failed = false;
}

static gboolean
gst_neighbour_code_parse_start (GstBaseParse *base)
{
  reset_stream (GST_NEIGHBOUR_CODE_PARSE (base)->priv);
  reset_min_frame_size (base);
  return TRUE;
}

static gboolean
gst_neighbour_code_parse_stop (GstBaseParse *base)
{
  reset_stream (GST_NEIGHBOUR_CODE_PARSE (base)->priv);
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
  gst_pad_add_probe (GST_BASE_PARSE_SRC_PAD (self), GST_PAD_PROBE_TYPE_EVENT_FLUSH,
      GST_DEBUG_FUNCPTR (handle_flush), self->priv, nullptr);
}

static void
gst_neighbour_code_parse_class_init (GstNeighbourCodeParseClass *klass)
{
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto parse_class = GST_BASE_PARSE_CLASS (klass);

  G_OBJECT_CLASS (klass)->finalize = gst_neighbour_code_parse_finalize;
  element_class->post_message = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_post_message);
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Neighbour code parser",
      "Codec/Parser/Converter/Video",
      "Converts between neighbour code byte streams and access units", "gst-rangecast");

  parse_class->start = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_start);
  parse_class->stop = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_stop);
  parse_class->set_sink_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_set_sink_caps);
  parse_class->sink_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_sink_event);
  parse_class->src_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_src_event);
  parse_class->handle_frame = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_handle_frame);
  parse_class->pre_push_frame = GST_DEBUG_FUNCPTR (gst_neighbour_code_parse_pre_push_frame);

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_parse_debug, "neighbourcodeparse", 0, "Neighbour code parser");
}
