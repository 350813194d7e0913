/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangemux:
 *
 * Combines the streams of several range cameras into frame sets, splits them, and keeps audio in
 * sync.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (capturesync)
GST_ELEMENT_REGISTER_DECLARE (rangedemux)
GST_ELEMENT_REGISTER_DECLARE (rangemux)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (capturesync, plugin);
  registered |= GST_ELEMENT_REGISTER (rangedemux, plugin);
  registered |= GST_ELEMENT_REGISTER (rangemux, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangemux,
    "Combines the streams of several range cameras into frame sets, splits them, and keeps audio "
    "in "
    "sync",
    plugin_init, PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
