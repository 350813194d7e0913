/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "srtp-key.hpp"

#include <atomic>
#include <string>

#include "srtp-gate.hpp"

namespace {

constexpr std::size_t kKeyBytes = 30;       /* of AES-128 in counter mode, RFC 3711 */
constexpr guint kClosedPackets = 20;        /* in a row, and ... */
constexpr gint64 kClosedTimeUs = 3'000'000; /* ... for this time, before it is reported */

/** What goes into a srtpdec and comes out of it; its streaming threads count. */
struct Watched {
  std::string name, path;
  std::atomic<guint> closed = 0;           /* undecryptable packets in a row */
  std::atomic<gint64> closed_since_us = 0; /* when the first of them came */
  bool reported = false;                   /* one streaming thread per pad, and one pad counts in */
};

GstBuffer *
read_key (const char *path)
{
  gchar *text = nullptr;
  guint8 key[kKeyBytes];
  bool good = g_file_get_contents (path, &text, nullptr, nullptr);
  if (good) {
    g_strstrip (text);
    good = strlen (text) == 2 * kKeyBytes;
  }
  for (std::size_t i = 0; good && i < kKeyBytes; i++) {
    const int high = g_ascii_xdigit_value (text[2 * i]),
              low = g_ascii_xdigit_value (text[2 * i + 1]);
    good = high >= 0 && low >= 0;
    key[i] = guint8 (high * 16 + low);
  }
  g_free (text);
  if (good)
    return gst_buffer_new_memdup (key, kKeyBytes);
  g_printerr ("rangecast-run: --srtp-key %s: expected a file of %zu hexadecimal digits\n", path,
      2 * kKeyBytes);
  return nullptr;
}

GstPadProbeReturn
on_packet_in (GstPad *, GstPadProbeInfo *, gpointer user_data)
{
  auto watched = static_cast<Watched *> (user_data);
  const gint64 now_us = g_get_monotonic_time ();
  if (watched->closed++ == 0)
    watched->closed_since_us = now_us;
  if (watched->closed >= kClosedPackets && now_us - watched->closed_since_us >= kClosedTimeUs &&
      !watched->reported) {
    watched->reported = true;
    g_printerr (
        "WARNING: %s: packets cannot be decrypted with the key in %s: the sender uses another "
        "key, or does not encrypt\n",
        watched->name.c_str (), watched->path.c_str ());
  }
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn
on_packet_out (GstPad *, GstPadProbeInfo *, gpointer user_data)
{
  auto watched = static_cast<Watched *> (user_data);
  watched->closed = 0;
  watched->reported = false;
  return GST_PAD_PROBE_OK;
}

void
watch (GstElement *decrypter, const char *path)
{
  const char *const ways[][2] = {{"rtp_sink", "rtp_src"}, {"rtcp_sink", "rtcp_src"}};
  for (const auto &way : ways) {
    auto watched = new Watched; /* lives as the pipeline */
    watched->name = GST_OBJECT_NAME (decrypter);
    watched->path = path;
    GstPad *in = gst_element_get_static_pad (decrypter, way[0]);
    GstPad *out = gst_element_get_static_pad (decrypter, way[1]);
    const auto types = GST_PAD_PROBE_TYPE_BUFFER;
    gst_pad_add_probe (in, types, on_packet_in, watched,
        [] (gpointer data) { delete static_cast<Watched *> (data); });
    gst_pad_add_probe (out, types, on_packet_out, watched, nullptr);
    gst_object_unref (in);
    gst_object_unref (out);
  }
}

} // namespace

bool
give_srtp_key (GstElement *pipeline, const char *path)
{
  GstBuffer *key = read_key (path);
  if (!key)
    return false;
  bool good = true;
  for (GList *item = GST_BIN_CHILDREN (pipeline); item && good; item = item->next) {
    GstElement *element = GST_ELEMENT (item->data);
    GstElementFactory *factory = gst_element_get_factory (element);
    const gchar *name = factory ? GST_OBJECT_NAME (factory) : "";
    if (g_str_equal (name, "srtpenc")) {
      g_object_set (element, "key", key, nullptr);
    } else if (g_str_equal (name, "srtpdec")) {
      watch (element, path); /* before the gate, to see packets that it drops */
      good = add_srtp_gate (element, key);
    }
  }
  gst_buffer_unref (key);
  if (!good)
    g_printerr ("rangecast-run: --srtp-key: cannot create the second srtpdec that tries packets\n");
  return good;
}
