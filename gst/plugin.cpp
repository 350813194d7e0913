/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The entry of each plugin. meson.build of its folder defines PLUGIN_NAME, PLUGIN_TEXT and
 * PLUGIN_ELEMENTS, which has ELEMENT (name) for each element. */
#include <gst/gst.h>

#define ELEMENT(name) GST_ELEMENT_REGISTER_DECLARE (name)
PLUGIN_ELEMENTS
#undef ELEMENT

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
#define ELEMENT(name) registered |= GST_ELEMENT_REGISTER (name, plugin);
  PLUGIN_ELEMENTS
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, PLUGIN_NAME, PLUGIN_TEXT, plugin_init,
    PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
