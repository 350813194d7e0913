/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* For LD_PRELOAD: a tee whose every push takes its time, queues that start late, appsinks that are
 * emptied late, as on a machine that is busy with other things just then. What is linked to a
 * running tee before it is started ends the stream then, and not once in a thousand times. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <stdbool.h>
#include <string.h>

static bool
is_made_by (GstElement *element, const char *factory)
{
  GstElementFactory *made_by = gst_element_get_factory (element);
  return made_by && strcmp (GST_OBJECT_NAME (made_by), factory) == 0;
}

GstFlowReturn
gst_pad_push_list (GstPad *pad, GstBufferList *list)
{
  GstFlowReturn (*push) (GstPad *, GstBufferList *) = dlsym (RTLD_NEXT, "gst_pad_push_list");
  const GstFlowReturn flow = push (pad, list);
  GstElement *element = gst_pad_get_parent_element (pad);
  if (element && is_made_by (element, "tee"))
    g_usleep (30000);
  gst_clear_object (&element);
  return flow;
}

/* Two of these come while one is on its way. */
GstSample *
gst_app_sink_pull_sample (GstAppSink *sink)
{
  GstSample *(*pull) (GstAppSink *) = dlsym (RTLD_NEXT, "gst_app_sink_pull_sample");
  g_usleep (100000);
  return pull (sink);
}

gboolean
gst_element_sync_state_with_parent (GstElement *element)
{
  gboolean (*sync) (GstElement *) = dlsym (RTLD_NEXT, "gst_element_sync_state_with_parent");
  if (is_made_by (element, "queue")) {
    g_printerr ("slow-plugging: %s\n", GST_OBJECT_NAME (element));
    g_usleep (400000);
  }
  return sync (element);
}
