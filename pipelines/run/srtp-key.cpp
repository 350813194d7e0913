/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "srtp-key.hpp"

#include <atomic>
#include <memory>
#include <string>
#include <utility>

namespace {

constexpr std::size_t kKeyBytes = 30;       /* of AES-128 in counter mode, RFC 3711 */
constexpr guint kClosedPackets = 20;        /* in a row, and ... */
constexpr gint64 kClosedTimeUs = 3'000'000; /* ... for this time, before it is reported */

/* srtpdec keeps 29 KB for each SSRC, authentic or not, until its signal clear-keys. */
constexpr guint kMaxStreams = 128;

/** What goes into a srtpdec and comes out of it; its streaming threads count. */
struct Watched {
  std::string name, path;
  GstElement *decrypter = nullptr;
  GstBuffer *key = nullptr;                /* a reference */
  std::atomic<guint> streams = 0;          /* SSRCs for which it has asked for the key */
  std::atomic<guint> closed = 0;           /* undecryptable packets in a row of one SSRC */
  std::atomic<gint64> closed_since_us = 0; /* when the first of them came */
  guint32 ssrc = 0;                        /* of the last packet */
  bool reported = false;                   /* one streaming thread per pad, and one pad counts in */

  ~Watched () { gst_buffer_unref (key); }
};

/* RFC 3711 counts how often the 16-bit sequence numbers have wrapped in a roll-over counter that no
 * packet carries, so whoever joins later cannot know it. Here it is 0 for everybody: when the
 * numbers have wrapped, the sender takes another SSRC, with the event by which rtpsession reports a
 * collision. The next SSRC, because rtpneighbourcodeguard recognises it, and because random ones
 * would repeat some day under one key. */
struct Numbers {
  guint ssrc = 0; /* of the payloader; others are of retransmissions */
  bool high = false;
};

struct Header {
  guint16 number;
  guint32 ssrc;
};

Header
read_header (GstBuffer *packet)
{
  guint8 header[12] = {};
  gst_buffer_extract (packet, 0, header, sizeof header);
  return {GST_READ_UINT16_BE (header + 2), GST_READ_UINT32_BE (header + 8)};
}

void
check_number (GstPad *pad, GstBuffer *packet, Numbers &numbers)
{
  const Header header = read_header (packet);
  if (header.ssrc != numbers.ssrc)
    return;
  if (numbers.high && header.number < 0x4000)
    gst_pad_push_event (
        pad, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM,
                 gst_structure_new ("GstRTPCollision", "ssrc", G_TYPE_UINT, numbers.ssrc,
                     "suggested-ssrc", G_TYPE_UINT, numbers.ssrc + 1, nullptr)));
  numbers.high = header.number >= 0xc000;
}

GstPadProbeReturn
on_packet_to_encrypt (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto &numbers = *static_cast<Numbers *> (user_data);
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
    check_number (pad, GST_PAD_PROBE_INFO_BUFFER (info), numbers);
  } else if (info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST) {
    GstBufferList *packets = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
    for (guint i = 0; i < gst_buffer_list_length (packets); i++)
      check_number (pad, gst_buffer_list_get (packets, i), numbers);
  } else if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_CAPS) {
    GstCaps *caps = nullptr;
    gst_event_parse_caps (GST_PAD_PROBE_INFO_EVENT (info), &caps);
    numbers = {};
    gst_structure_get_uint (gst_caps_get_structure (caps, 0), "ssrc", &numbers.ssrc);
  }
  return GST_PAD_PROBE_OK;
}

/* FEC adds packets to a stream, with numbers of their own. The payloader's numbers are shifted, so
 * that a new SSRC goes on where the old one ended behind the FEC. */
struct LastNumber {
  guint32 ssrc = 0;
  guint16 number = 0;
};

/* `user_data`: of rtpulpfecenc's packets. */
GstPadProbeReturn
on_fec_packet (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto &last = **static_cast<std::shared_ptr<LastNumber> *> (user_data);
  GstBuffer *packet = GST_PAD_PROBE_INFO_BUFFER (info);
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST) {
    GstBufferList *packets = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
    packet = gst_buffer_list_get (packets, gst_buffer_list_length (packets) - 1);
  }
  const Header header = read_header (packet);
  last = {header.ssrc, header.number};
  return GST_PAD_PROBE_OK;
}

struct Shift {
  std::shared_ptr<const LastNumber> last;
  guint32 ssrc = 0;
  guint16 shift = 0;
};

void
shift_number (GstBuffer *packet, Shift &shift)
{
  const Header header = read_header (packet);
  const guint32 before = std::exchange (shift.ssrc, header.ssrc);
  if (before != 0 && header.ssrc != before && before == shift.last->ssrc)
    shift.shift = guint16 (shift.last->number + 1 - header.number);
  const guint16 number = GUINT16_TO_BE (guint16 (header.number + shift.shift));
  if (shift.shift != 0)
    gst_buffer_fill (packet, 2, &number, sizeof number);
}

GstPadProbeReturn
on_payload (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto &shift = *static_cast<Shift *> (user_data);
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
    GstBuffer *packet = gst_buffer_make_writable (GST_PAD_PROBE_INFO_BUFFER (info));
    shift_number (packet, shift);
    info->data = packet;
  } else {
    GstBufferList *packets = gst_buffer_list_make_writable (GST_PAD_PROBE_INFO_BUFFER_LIST (info));
    for (guint i = 0; i < gst_buffer_list_length (packets); i++)
      shift_number (gst_buffer_list_get_writable (packets, i), shift);
    info->data = packets;
  }
  return GST_PAD_PROBE_OK;
}

/* rtpstorage keeps the last packets of each SSRC for ever. The guard before it announces another
 * sender by caps. */
GstPadProbeReturn
on_storage_event (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  GstElement *storage = *static_cast<GstElement **> (user_data);
  guint64 time = 0;
  if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) != GST_EVENT_CAPS)
    return GST_PAD_PROBE_OK;
  g_object_get (storage, "size-time", &time, nullptr);
  g_object_set (storage, "size-time", guint64{0}, nullptr); /* clears it */
  g_object_set (storage, "size-time", time, nullptr);
  return GST_PAD_PROBE_OK;
}

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
  g_printerr (
      "rangecast-run: --srtp-key %s: give a file of %zu hexadecimal digits\n", path, 2 * kKeyBytes);
  return nullptr;
}

GstPadProbeReturn
on_packet_in (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  const int ssrc_at = g_str_has_prefix (GST_PAD_NAME (pad), "rtcp") ? 4 : 8;
  guint32 ssrc = 0;
  gst_buffer_extract (GST_PAD_PROBE_INFO_BUFFER (info), ssrc_at, &ssrc, sizeof ssrc);
  auto watched = static_cast<Watched *> (user_data);
  const gint64 now_us = g_get_monotonic_time ();
  if (watched->streams >= kMaxStreams) {
    watched->streams = 0;
    g_signal_emit_by_name (watched->decrypter, "clear-keys"); /* it asks again for those in use */
  }
  if (ssrc != std::exchange (watched->ssrc, ssrc))
    watched->closed = 0; /* random bytes are no sender with another key */
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

/* @param state  lives as long as the pad */
template <typename State>
void
add_probe (GstPad *pad, int types, GstPadProbeCallback callback, State state)
{
  gst_pad_add_probe (pad, GstPadProbeType (types), callback, new State (std::move (state)),
      [] (gpointer data) { delete static_cast<State *> (data); });
}

GstCaps *
on_key (GstElement *, guint ssrc, gpointer user_data)
{
  auto watched = static_cast<Watched *> (user_data);
  watched->streams++;
  return gst_caps_new_simple ("application/x-srtp", "ssrc", G_TYPE_UINT, ssrc, "srtp-key",
      GST_TYPE_BUFFER, watched->key, "srtp-cipher", G_TYPE_STRING, "aes-128-icm", "srtp-auth",
      G_TYPE_STRING, "hmac-sha1-80", "srtcp-cipher", G_TYPE_STRING, "aes-128-icm", "srtcp-auth",
      G_TYPE_STRING, "hmac-sha1-80", nullptr);
}

void
give_key (GstElement *decrypter, GstBuffer *key, const char *path)
{
  auto watched = new Watched{.name = GST_OBJECT_NAME (decrypter),
      .path = path,
      .decrypter = decrypter,
      .key = gst_buffer_ref (key)};
  g_object_set_data_full (G_OBJECT (decrypter), "rangecast-srtp", watched,
      [] (gpointer data) { delete static_cast<Watched *> (data); });
  g_signal_connect (decrypter, "request-key", G_CALLBACK (on_key), watched);
  for (const char *name : {"rtp_sink", "rtcp_sink", "rtp_src", "rtcp_src"}) {
    GstPad *pad = gst_element_get_static_pad (decrypter, name);
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER,
        GST_PAD_IS_SINK (pad) ? on_packet_in : on_packet_out, watched, nullptr);
    gst_object_unref (pad);
  }
}

void
watch_pad (GstPad *pad, GstElementFactory *factory, const std::shared_ptr<LastNumber> &last)
{
  constexpr int kPackets = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST,
                kEvents = GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM;
  const gchar *element = factory ? GST_OBJECT_NAME (factory) : "";
  const GstPadTemplate *pads = GST_PAD_PAD_TEMPLATE (pad);
  const bool is_source = GST_PAD_IS_SRC (pad);
  if (g_str_equal (element, "srtpenc") &&
      g_str_has_prefix (GST_PAD_TEMPLATE_NAME_TEMPLATE (pads), "rtp_sink"))
    add_probe (pad, kPackets | kEvents, on_packet_to_encrypt, Numbers{});
  else if (g_str_equal (element, "rtpulpfecenc") && is_source)
    add_probe (pad, kPackets, on_fec_packet, last);
  else if (g_str_equal (element, "rtpstorage") && !is_source)
    add_probe (pad, kEvents, on_storage_event, GST_ELEMENT (GST_PAD_PARENT (pad)));
  else if (factory && is_source &&
           gst_element_factory_list_is_type (factory, GST_ELEMENT_FACTORY_TYPE_PAYLOADER))
    add_probe (pad, kPackets, on_payload, Shift{.last = last});
}

} // namespace

bool
give_srtp_key (GstElement *pipeline, const char *path)
{
  GstBuffer *key = read_key (path);
  if (!key)
    return false;
  const auto last = std::make_shared<LastNumber> ();
  for (GList *item = GST_BIN_CHILDREN (pipeline); item; item = item->next) {
    GstElement *element = GST_ELEMENT (item->data);
    GstElementFactory *factory = gst_element_get_factory (element);
    const gchar *name = factory ? GST_OBJECT_NAME (factory) : "";
    if (g_str_equal (name, "srtpenc"))
      g_object_set (element, "key", key, nullptr);
    else if (g_str_equal (name, "srtpdec"))
      give_key (element, key, path);
    for (GList *pad = element->pads; pad; pad = pad->next)
      watch_pad (GST_PAD (pad->data), factory, last);
  }
  gst_buffer_unref (key);
  return true;
}
