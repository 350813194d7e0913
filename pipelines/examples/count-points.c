/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How an application reads range frame sets: prints how many points each view has, and where
 * their centre is, for every frame set of a recording.
 *
 * usage: count-points RECORDING
 * build: cc count-points.c $(pkg-config --cflags --libs gstrange-1.0 gstreamer-app-1.0) */
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gstrange/gstrange.h>

static void
print_view (const GstRangeView *view, const GstRangeCamera *camera)
{
  gdouble centre[3] = {0, 0, 0};
  guint points = 0;

  for (guint row = 0; row < view->height; row++) {
    const guint16 *depth =
        (const guint16 *)((const guint8 *)view->depth + row * view->depth_stride);
    for (guint column = 0; column < view->width; column++) {
      if (depth[column] == 0)
        continue;
      const gdouble z = depth[column] * camera->depth_unit;
      const gdouble p[3] = {(view->x + column - camera->cx) / camera->fx * z,
          (view->y + row - camera->cy) / camera->fy * z, z};
      for (int i = 0; i < 3; i++) {
        const gdouble *r = &camera->world_from_view[4 * i];
        centre[i] += r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3];
      }
      points++;
    }
  }
  g_print ("  view %u: %u points", view->view_id, points);
  if (points)
    g_print (
        ", centre %.3f %.3f %.3f m", centre[0] / points, centre[1] / points, centre[2] / points);
  g_print ("\n");
}

static void
print_frame_set (GstSample *sample)
{
  GstBuffer *buffer = gst_sample_get_buffer (sample);
  GstCaps *caps = gst_sample_get_caps (sample);
  gpointer state = NULL;
  GstRangeMeta *meta;

  g_print ("frame set at %" GST_TIME_FORMAT "\n", GST_TIME_ARGS (GST_BUFFER_PTS (buffer)));
  while ((meta = gst_buffer_iterate_range_meta (buffer, &state))) {
    GstRangeView view;
    GstRangeCamera camera;
    if (!gst_range_caps_get_camera (caps, meta->view_id, &camera) ||
        !gst_range_view_map (&view, buffer, meta, GST_MAP_READ))
      continue;
    print_view (&view, &camera);
    gst_range_view_unmap (&view);
  }
}

int
main (int argc, char **argv)
{
  gst_init (&argc, &argv);
  if (argc != 2) {
    g_printerr ("usage: count-points RECORDING\n");
    return 2;
  }

  GError *error = NULL;
  GstElement *pipeline = gst_parse_launch (
      "filesrc name=file ! neighbourcodeparse ! neighbourcodedec ! appsink name=sink sync=false",
      &error);
  if (error) {
    g_printerr ("count-points: %s\n", error->message);
    g_clear_error (&error);
    gst_clear_object (&pipeline);
    return 1;
  }
  GstElement *file = gst_bin_get_by_name (GST_BIN (pipeline), "file");
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "sink");
  g_object_set (file, "location", argv[1], NULL);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);

  /* An error (no such file, say) ends no stream: the bus must be heard, too. */
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = NULL;
  while (!message && !gst_app_sink_is_eos (GST_APP_SINK (sink))) {
    GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (sink), 100 * GST_MSECOND);
    if (sample) {
      print_frame_set (sample);
      gst_sample_unref (sample);
    } else {
      message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
    }
  }
  if (message) {
    gst_message_parse_error (message, &error, NULL);
    g_printerr ("count-points: %s\n", error->message);
    g_error_free (error);
    gst_message_unref (message);
  }
  gst_object_unref (bus);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (file);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
  return message ? 1 : 0;
}
