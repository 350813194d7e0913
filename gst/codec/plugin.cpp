/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-neighbourcode:
 *
 * Neighbour code: compresses range frame sets (depth and colour) without meshes.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (neighbourcodedec)
GST_ELEMENT_REGISTER_DECLARE (neighbourcodeenc)
GST_ELEMENT_REGISTER_DECLARE (neighbourcodeparse)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (neighbourcodedec, plugin);
  registered |= GST_ELEMENT_REGISTER (neighbourcodeenc, plugin);
  registered |= GST_ELEMENT_REGISTER (neighbourcodeparse, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, neighbourcode,
    "Neighbour code: compresses range frame sets (depth and colour) without meshes", plugin_init,
    PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
