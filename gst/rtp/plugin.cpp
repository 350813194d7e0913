/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * plugin-rtpneighbourcode:
 *
 * Neighbour code over RTP: payloader, depayloader and source guard.
 */
#include <gst/gst.h>

GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodedepay)
GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodeguard)
GST_ELEMENT_REGISTER_DECLARE (rtpneighbourcodepay)

static gboolean
plugin_init (GstPlugin *plugin)
{
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER (rtpneighbourcodedepay, plugin);
  registered |= GST_ELEMENT_REGISTER (rtpneighbourcodeguard, plugin);
  registered |= GST_ELEMENT_REGISTER (rtpneighbourcodepay, plugin);
  return registered;
}

GST_PLUGIN_DEFINE (GST_VERSION_MAJOR, GST_VERSION_MINOR, rtpneighbourcode,
    "Neighbour code over RTP: payloader, depayloader and source guard", plugin_init,
    PACKAGE_VERSION, "LGPL", "gst-rangecast", PACKAGE_ORIGIN)
