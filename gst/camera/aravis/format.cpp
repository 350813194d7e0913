/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "format.hpp"

#include <algorithm>

namespace {

const PixelFormat kFormats[] = {
    {ARV_PIXEL_FORMAT_MONO_8, "Mono8", GST_VIDEO_FORMAT_GRAY8, "", 1},
    {ARV_PIXEL_FORMAT_RGB_8_PACKED, "RGB8", GST_VIDEO_FORMAT_RGB, "", 3},
    {ARV_PIXEL_FORMAT_BGR_8_PACKED, "BGR8", GST_VIDEO_FORMAT_BGR, "", 3},
    {ARV_PIXEL_FORMAT_BAYER_RG_8, "BayerRG8", GST_VIDEO_FORMAT_UNKNOWN, "rggb", 1},
    {ARV_PIXEL_FORMAT_BAYER_BG_8, "BayerBG8", GST_VIDEO_FORMAT_UNKNOWN, "bggr", 1},
    {ARV_PIXEL_FORMAT_BAYER_GB_8, "BayerGB8", GST_VIDEO_FORMAT_UNKNOWN, "gbrg", 1},
    {ARV_PIXEL_FORMAT_BAYER_GR_8, "BayerGR8", GST_VIDEO_FORMAT_UNKNOWN, "grbg", 1},
};

GstCaps *
media_type (GstVideoFormat format, const char *bayer)
{
  return format == GST_VIDEO_FORMAT_UNKNOWN
             ? gst_caps_new_simple ("video/x-bayer", "format", G_TYPE_STRING, bayer, nullptr)
             : gst_caps_new_simple ("video/x-raw", "format", G_TYPE_STRING,
                   gst_video_format_to_string (format), nullptr);
}

GstCaps *
caps_of (const PixelFormat &format)
{
  GstCaps *caps = media_type (format.video_format, format.bayer);
  gst_caps_set_simple (caps, "width", GST_TYPE_INT_RANGE, 1, G_MAXINT, "height", GST_TYPE_INT_RANGE,
      1, G_MAXINT, "framerate", GST_TYPE_FRACTION_RANGE, 0, 1, G_MAXINT, 1, nullptr);
  return caps;
}

} // namespace

const PixelFormat *
find_pixel_format (const std::string &name)
{
  /* older cameras say RGB8Packed where newer ones say RGB8 */
  const std::string plain = name.ends_with ("8Packed") ? name.substr (0, name.size () - 6) : name;
  const auto *found = std::ranges::find (kFormats, plain, &PixelFormat::name);
  return found == std::end (kFormats) ? nullptr : found;
}

GstCaps *
camera_caps ()
{
  GstCaps *caps = gst_caps_new_empty ();
  for (const PixelFormat &format : kFormats)
    gst_caps_append (caps, caps_of (format));
  return caps;
}

std::string
pixel_format_for_caps (const GstCaps *caps, const std::vector<std::string> &has)
{
  for (const std::string &name : has) {
    const PixelFormat *format = find_pixel_format (name);
    if (!format)
      continue;
    GstCaps *mine = caps_of (*format);
    const bool fits = gst_caps_can_intersect (mine, caps);
    gst_caps_unref (mine);
    if (fits)
      return name;
  }
  return "";
}

GstCaps *
CameraFormat::caps () const
{
  GstCaps *caps = media_type (video_format, bayer.c_str ());
  gst_caps_set_simple (caps, "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, nullptr);
  return caps;
}
