/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangeweb:
 *
 * Coded frame sets to browsers.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (rangewebsink)

static gboolean
plugin_init (GstPlugin *plugin)
{
  return GST_ELEMENT_REGISTER (rangewebsink, plugin);
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangeweb, "Coded frame sets to browsers",
    plugin_init, PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
