/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any caps, by the first byte: their text; or fields of the right types, numbers and a rig's blob,
 * so that not each run has to spell them. What parse_caps() takes, it makes again. */
#include <gst/gst.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeinfo.hpp>
#include <span>
#include <string>

using Bytes = std::span<const guint8>;

enum Kind { kText = 1, kCoded = 2 }; /* the first byte is a sum of these */

static void
expect (bool fact)
{
  if (!fact)
    std::abort ();
}

static GstCaps *
caps_of_text (Bytes bytes)
{
  const std::string text (bytes.begin (), bytes.end ());
  return gst_caps_from_string (text.c_str ());
}

static GstCaps *
caps_of_fields (Bytes bytes, bool coded)
{
  std::array<gint, 5> numbers{}; /* width, height, views, frame rate */
  const gsize used = std::min (bytes.size (), sizeof numbers);
  std::memcpy (numbers.data (), bytes.data (), used);
  GstCaps *caps = coded ? gst_caps_new_simple (GST_NEIGHBOUR_CODE_MEDIA_TYPE, "version", G_TYPE_INT,
                              1, "alignment", G_TYPE_STRING, "access-unit", nullptr)
                        : gst_caps_new_simple (
                              GST_RANGE_MEDIA_TYPE, "format", G_TYPE_STRING, "Z16_RGBx", nullptr);
  gst_caps_set_simple (caps, "width", G_TYPE_INT, numbers[0], "height", G_TYPE_INT, numbers[1],
      "views", G_TYPE_INT, numbers[2], nullptr);
  if (numbers[4] != 0 && numbers[3] > -G_MAXINT && numbers[4] > -G_MAXINT)
    gst_caps_set_simple (caps, "framerate", GST_TYPE_FRACTION, numbers[3], numbers[4], nullptr);
  GstBuffer *rig = gst_buffer_new_memdup (bytes.data () + used, bytes.size () - used);
  gst_caps_set_simple (caps, "rig", GST_TYPE_BUFFER, rig, nullptr);
  gst_buffer_unref (rig);
  return caps;
}

static void
check (const GstCaps *caps)
{
  gstrange::RangeInfo info, again;
  GstRangeCamera camera;
  if (!gstrange::parse_caps (caps, info).ok ()) {
    expect (!gst_range_caps_get_camera (caps, 0, &camera));
    return;
  }
  expect (info.views () <= rangecast::kMaxViews && rangecast::validate (info.rig).ok ());
  for (const rangecast::View &view : info.rig.views)
    expect (view.width <= info.width && view.height <= info.height &&
            gst_range_caps_get_camera (caps, guint (view.id), &camera) &&
            camera.width == view.width);
  (void)info.frame_duration ();
  GstCaps *made = gstrange::make_neighbour_code_caps (info);
  expect (gstrange::parse_caps (made, again).ok () && again.width == info.width &&
          rangecast::encode_rig (again.rig) == rangecast::encode_rig (info.rig));
  gst_caps_unref (made);
}

static void
recode (GstCaps *caps)
{
  for (const bool coded : {false, true}) {
    GstCaps *other = gstrange::recode_caps (caps, coded, nullptr);
    expect (gst_caps_get_size (other) <= gst_caps_get_size (caps));
    GstCaps *filtered = gstrange::recode_caps (caps, coded, other);
    gst_caps_unref (filtered);
    gst_caps_unref (other);
  }
}

static void
be_quiet (const gchar *, GLogLevelFlags, const gchar *, gpointer)
{
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  if (!gst_is_initialized ()) {
    gst_init (nullptr, nullptr);
    g_log_set_default_handler (be_quiet, nullptr); /* GStreamer says much of caps it cannot read */
  }
  if (size == 0)
    return 0;
  const Bytes bytes (data + 1, size - 1);
  GstCaps *caps = data[0] & kText ? caps_of_text (bytes) : caps_of_fields (bytes, data[0] & kCoded);
  if (!caps)
    return 0;
  check (caps);
  if (!gst_caps_is_any (caps))
    recode (caps);
  gst_caps_unref (caps);
  return 0;
}
