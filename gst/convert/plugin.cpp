/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangeconvert:
 *
 * Range frame sets to video streams and PLY point clouds.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (plyenc)
GST_ELEMENT_REGISTER_DECLARE (rangesplit)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (plyenc, plugin);
  registered |= GST_ELEMENT_REGISTER (rangesplit, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangeconvert,
    "Range frame sets to video streams and PLY point clouds", plugin_init, PACKAGE_VERSION, "LGPL",
    "gst-rangecast", PACKAGE_ORIGIN)
