/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangemux clock-port. */
#include "../rangecast-check.hpp"

#include <gio/gio.h>
#include <gst/net/gstnet.h>

#include <vector>

using namespace rangecast::testing;

/* A pipeline with a rangemux that plays. */
struct Parent {
  GstElement *pipeline, *mux;

  explicit Parent (const std::string &properties)
  {
    pipeline = gst_parse_launch (
        ("rangemux name=m " + properties + " ! fakesink async=false").c_str (), nullptr);
    mux = gst_bin_get_by_name (GST_BIN (pipeline), "m");
  }
  ~Parent ()
  {
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (mux);
    gst_object_unref (pipeline);
  }
  bool go_to (GstState state)
  {
    return gst_element_set_state (pipeline, state) != GST_STATE_CHANGE_FAILURE &&
           gst_element_get_state (pipeline, nullptr, nullptr, 10 * GST_SECOND) ==
               GST_STATE_CHANGE_SUCCESS;
  }
};

/* A socket that nobody shares. */
static GSocket *
take_port (int port)
{
  GSocket *socket =
      g_socket_new (G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  GInetAddress *any = g_inet_address_new_any (G_SOCKET_FAMILY_IPV4);
  GSocketAddress *address = g_inet_socket_address_new (any, guint16 (port));
  const bool bound = g_socket_bind (socket, address, FALSE, nullptr);
  g_object_unref (address);
  g_object_unref (any);
  if (!bound)
    g_clear_object (&socket);
  return socket;
}

static int
port_of (GSocket *socket)
{
  GSocketAddress *address = g_socket_get_local_address (socket, nullptr);
  const int port = g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (address));
  g_object_unref (address);
  return port;
}

/* How far a client of that port is from a clock once it has synchronised. Clients are kept: one
 * that goes while it is told that it is synchronised is used after it is freed (GStreamer 1.22). */
static GstClockTimeDiff
client_error (int port, GstClock *clock)
{
  static std::vector<GstClock *> kept;
  GstClock *client = gst_net_client_clock_new ("client", "127.0.0.1", port, 0);
  fail_unless (gst_clock_wait_for_sync (client, 20 * GST_SECOND));
  const GstClockTimeDiff error =
      GST_CLOCK_DIFF (gst_clock_get_time (client), gst_clock_get_time (clock));
  kept.push_back (client);
  return ABS (error);
}

/* The system clock, so much ahead. */
static GstClock *
clock_ahead (GstClockTime ahead)
{
  GstClock *clock = GST_CLOCK (g_object_new (GST_TYPE_SYSTEM_CLOCK, "name", "ahead", nullptr));
  gst_object_ref_sink (clock);
  const GstClockTime internal = gst_clock_get_internal_time (clock);
  gst_clock_set_calibration (clock, internal, internal + ahead, 1, 1);
  return clock;
}

GST_START_TEST (test_net_client_clock_gets_the_pipelines_time)
{
  GSocket *socket = take_port (0);
  const int port = port_of (socket);
  g_object_unref (socket);
  Parent parent ("clock-port=" + std::to_string (port));
  GstClock *clock = clock_ahead (3600 * GST_SECOND);
  gst_pipeline_use_clock (GST_PIPELINE (parent.pipeline), clock);
  fail_unless (parent.go_to (GST_STATE_PLAYING));
  ck_assert_int_lt (client_error (port, clock), 5 * GST_SECOND);
  gst_object_unref (clock);
}
GST_END_TEST;

GST_START_TEST (test_port_in_use_is_one_error_that_names_it)
{
  GSocket *socket = take_port (0);
  const std::string port = std::to_string (port_of (socket));
  Parent parent ("clock-port=" + port);
  GstBus *bus = gst_element_get_bus (parent.pipeline);
  fail_unless (!parent.go_to (GST_STATE_PLAYING));
  const std::string text = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless (
      text.find ("clock-port") != text.npos && text.find (port) != text.npos, text.c_str ());
  GstMessage *second = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
  fail_unless (second == nullptr, "more than one error");
  g_object_unref (socket); /* and when it is free again: */
  fail_unless (parent.go_to (GST_STATE_NULL));
  fail_unless (parent.go_to (GST_STATE_PLAYING));
  gst_object_unref (bus);
}
GST_END_TEST;

static Suite *
rangemuxclock_suite ()
{
  Suite *s = suite_create ("rangemuxclock");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_net_client_clock_gets_the_pipelines_time);
  tcase_add_test (tc, test_port_in_use_is_one_error_that_names_it);
  return s;
}

GST_CHECK_MAIN (rangemuxclock);
