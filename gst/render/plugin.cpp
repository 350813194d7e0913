/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangerender:
 *
 * Removes redundant points of range frame sets and renders them with OpenGL.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (cylinderfilter)
#ifdef RANGECAST_HAVE_GL
GST_ELEMENT_REGISTER_DECLARE (rangerender)
GST_ELEMENT_REGISTER_DECLARE (striprender)
#endif

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (cylinderfilter, plugin);
#ifdef RANGECAST_HAVE_GL
  registered |= GST_ELEMENT_REGISTER (rangerender, plugin);
  registered |= GST_ELEMENT_REGISTER (striprender, plugin);
#endif
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangerender,
    "Removes redundant points of range frame sets and renders them with OpenGL", plugin_init,
    PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
