/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rangecast:
 *
 * Live 3D avatars from ordinary pipelines: range images from stereo cameras, the neighbour code
 * to send them, and a viewer that draws them without building a mesh.
 */

#include <gst/gst.h>

/* rangecast-elements.h is written by meson: one RANGECAST_ELEMENT (name) for each that is built. */
#define RANGECAST_ELEMENT(name) GST_ELEMENT_REGISTER_DECLARE (name)
#include "rangecast-elements.h"
#undef RANGECAST_ELEMENT
#ifdef RANGECAST_HAVE_DEVICE_PROVIDER
GST_DEVICE_PROVIDER_REGISTER_DECLARE (rangecastdeviceprovider)
#endif

static gboolean
plugin_init ([[maybe_unused]] GstPlugin *plugin)
{
  gboolean registered = FALSE;
#define RANGECAST_ELEMENT(name) registered |= GST_ELEMENT_REGISTER (name, plugin);
#include "rangecast-elements.h"
#undef RANGECAST_ELEMENT
#ifdef RANGECAST_HAVE_DEVICE_PROVIDER
  registered |= GST_DEVICE_PROVIDER_REGISTER (rangecastdeviceprovider, plugin);
#endif
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rangecast,
    "Live 3D avatars as coloured point clouds", plugin_init, PACKAGE_VERSION, "LGPL",
    "gst-rangecast", PACKAGE_ORIGIN)
