/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangerender:
 *
 * Renders range frame sets.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (rangerender)
GST_ELEMENT_REGISTER_DECLARE (striprender)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (rangerender, plugin);
  registered |= GST_ELEMENT_REGISTER (striprender, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangerender, "Renders range frame sets",
    plugin_init, PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
