/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clock.hpp"

#include <gst/net/gstnet.h>

#include <string>
#include <utility>

namespace {

/* @return transfer full; nullptr after reporting a wrong name */
GstClock *
open_net_clock (const std::string &name)
{
  const auto colon = name.rfind (':');
  guint64 port = 0;
  if (colon == name.npos || colon == 0 ||
      !g_ascii_string_to_unsigned (name.c_str () + colon + 1, 10, 1, 65535, &port, nullptr)) {
    g_printerr ("rangecast-run: --clock: expected system or HOST:PORT, got '%s'\n", name.c_str ());
    return nullptr;
  }
  GstClock *clock =
      gst_net_client_clock_new (nullptr, name.substr (0, colon).c_str (), int (port), 0);
  bool told = false;
  while (!gst_clock_wait_for_sync (clock, 2 * GST_SECOND))
    if (!std::exchange (told, true))
      g_printerr ("rangecast-run: waiting for the clock at %s\n", name.c_str ());
  return clock;
}

} // namespace

bool
use_clock (GstElement *pipeline, const char *name)
{
  GstClock *clock =
      g_strcmp0 (name, "system") == 0 ? gst_system_clock_obtain () : open_net_clock (name);
  if (!clock)
    return false;
  gst_pipeline_use_clock (GST_PIPELINE (pipeline), clock);
  gst_object_unref (clock);
  return true;
}
