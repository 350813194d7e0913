/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The filter that lets one sender's packets into a UDP socket. */
#include "rtp/senderfilter.hpp"

#include <gio/gunixsocketaddress.h>

#include <map>
#include <string>

#include "../rangecast-check.hpp"

using namespace rangecast::testing;

/* A socket of its own port on that address; null if the machine has no such address. */
static GSocket *
open_socket (const char *text)
{
  GInetAddress *address = g_inet_address_new_from_string (text);
  GSocketAddress *full = g_inet_socket_address_new (address, 0);
  GSocket *socket = g_socket_new (
      g_inet_address_get_family (address), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  if (socket && !g_socket_bind (socket, full, FALSE, nullptr))
    g_clear_object (&socket);
  g_object_unref (full);
  g_object_unref (address);
  return socket;
}

/* Sends so many packets from each of two sockets to a third, and counts what comes, by sender. */
static std::map<std::string, int>
exchange (GSocket *to, GSocket *good, GSocket *other, int packets)
{
  std::map<std::string, int> came;
  GSocketAddress *address = g_socket_get_local_address (to, nullptr);
  g_socket_set_blocking (to, FALSE);
  const auto take = [&] {
    char bytes[16];
    for (gssize size; (size = g_socket_receive (to, bytes, sizeof bytes, nullptr, nullptr)) > 0;)
      came[std::string (bytes, gsize (size))]++;
  };
  for (int i = 0; i < packets; i++) {
    g_socket_send_to (good, address, "good", 4, nullptr, nullptr);
    g_socket_send_to (other, address, "other", 5, nullptr, nullptr);
    take ();
  }
  g_object_unref (address);
  return came;
}

static void
check_filter (const char *text)
{
  GSocket *to = open_socket (text), *good = open_socket (text), *other = open_socket (text);
  if (!to || !good || !other)
    RANGECAST_SKIP (text);
  GSocketAddress *sender = g_socket_get_local_address (good, nullptr);
  if (!SenderFilter::attach (to, sender))
    RANGECAST_SKIP ("this system filters no sockets");
  constexpr int kPackets = 2000;
  auto came = exchange (to, good, other, kPackets);
  fail_unless_equals_int (came["good"], kPackets);
  ck_assert_int_gt (came["other"], 0);
  ck_assert_int_lt (came["other"], kPackets / 2); /* an eighth, more or less */
  SenderFilter::detach (to);
  came = exchange (to, good, other, 100);
  fail_unless_equals_int (came["good"], 100);
  fail_unless_equals_int (came["other"], 100);
  g_object_unref (sender);
  for (GSocket *socket : {to, good, other})
    g_object_unref (socket);
}

GST_START_TEST (test_one_sender_comes_whole_and_a_sample_of_others)
{
  check_filter ("127.0.0.1");
}
GST_END_TEST;

GST_START_TEST (test_one_sender_comes_whole_over_ipv6)
{
  check_filter ("::1");
}
GST_END_TEST;

GST_START_TEST (test_a_sender_that_has_no_internet_address_is_not_filtered_for)
{
  GSocket *to = open_socket ("127.0.0.1");
  GSocketAddress *local = g_unix_socket_address_new ("nowhere");
  fail_if (SenderFilter::attach (to, local));
  g_object_unref (local);
  g_object_unref (to);
}
GST_END_TEST;

static Suite *
senderfilter_suite ()
{
  Suite *suite = suite_create ("senderfilter");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_one_sender_comes_whole_and_a_sample_of_others);
  tcase_add_test (tc, test_one_sender_comes_whole_over_ipv6);
  tcase_add_test (tc, test_a_sender_that_has_no_internet_address_is_not_filtered_for);
  return suite;
}

GST_CHECK_MAIN (senderfilter);
