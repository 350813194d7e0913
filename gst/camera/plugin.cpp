/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangecamera:
 *
 * Stereo cameras through Aravis.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (stereocamsrc)
GST_DEVICE_PROVIDER_REGISTER_DECLARE (rangecastdeviceprovider)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (stereocamsrc, plugin);
  registered |= GST_DEVICE_PROVIDER_REGISTER (rangecastdeviceprovider, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangecamera,
    "Stereo cameras through Aravis", plugin_init, PACKAGE_VERSION, "LGPL", "gst-rangecast",
    PACKAGE_ORIGIN)
