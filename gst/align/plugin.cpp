/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangealign:
 *
 * Makes the views of range frame sets agree and removes their redundant points.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (cylinderfilter)
GST_ELEMENT_REGISTER_DECLARE (rangealign)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (cylinderfilter, plugin);
  registered |= GST_ELEMENT_REGISTER (rangealign, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangealign,
    "Makes the views of range frame sets agree and removes their redundant points", plugin_init,
    PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
