/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangedepth:
 *
 * Range images from stereo or depth cameras, cut to the person.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (rangecombine)
GST_ELEMENT_REGISTER_DECLARE (roiextract)
GST_ELEMENT_REGISTER_DECLARE (stereodepth)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (rangecombine, plugin);
  registered |= GST_ELEMENT_REGISTER (roiextract, plugin);
  registered |= GST_ELEMENT_REGISTER (stereodepth, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangedepth,
    "Range images from stereo or depth cameras, cut to the person", plugin_init, PACKAGE_VERSION,
    "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
