/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangecalibration:
 *
 * Calibrates a rig of cameras with a board.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (rigcalibrate)

static gboolean
plugin_init (GstPlugin *plugin)
{
  return GST_ELEMENT_REGISTER (rigcalibrate, plugin);
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangecalibration,
    "Calibrates a rig of cameras with a board", plugin_init, PACKAGE_VERSION, "LGPL",
    "gst-rangecast", PACKAGE_ORIGIN)
