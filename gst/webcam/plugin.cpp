/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangewebcam:
 *
 * Finds stereo webcams.
 */
#include <gst/gst.h>

GST_DEVICE_PROVIDER_REGISTER_DECLARE (stereowebcamprovider)

static gboolean
plugin_init (GstPlugin *plugin)
{
  return GST_DEVICE_PROVIDER_REGISTER (stereowebcamprovider, plugin);
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangewebcam, "Finds stereo webcams",
    plugin_init, PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
