/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangetestsrc:
 *
 * Synthetic rig of stereo or range cameras around a moving person.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (avatartestsrc)

static gboolean
plugin_init (GstPlugin *plugin)
{
  return GST_ELEMENT_REGISTER (avatartestsrc, plugin);
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangetestsrc,
    "Synthetic rig of stereo or range cameras around a moving person", plugin_init, PACKAGE_VERSION,
    "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
