/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "srtp-gate.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <vector>

#include "srtp-trial.hpp"

namespace {

constexpr std::size_t kMaxKnown = 256, kKept = 128; /* senders; after some are forgotten */
constexpr guint kClosedPackets = 64;                /* in a row of a sender who is known, ... */
constexpr gint64 kClosedTimeUs = 2'000'000; /* ... and this time: look for its current index */
constexpr gint64 kGoneTimeUs = 10'000'000;  /* after this time it may have started over */

/* A sender who has the key. An index is a packet's sequence number with the roll-over counter
 * before it, as RFC 3711, 3.3.1 has it. */
struct Known {
  guint32 ssrc = 0;
  std::optional<gint64> index = {}; /* the largest one; nothing before a packet of RTP */
  gint64 peak = -1;                 /* the same, of before it seemed to start over, too */
  gint64 floor = -1;                /* no packet with a smaller or the same one: a replay */
  guint roll_over = 0;              /* of the packet that goes to the srtpdec next */
  bool asked = false;               /* the srtpdec has its key */
  guint closed = 0;                 /* packets that did not open, since one did */
  gint64 opened_us = 0;             /* when the last one did */
  guint64 use = 0;

  /* Or a replay of its packets: the sender may come back. */
  [[nodiscard]] bool started_over () const { return index < peak; }
};

struct Gate {
  explicit Gate (GstElement *decrypter, GstBuffer *its_key)
      : element (decrypter), key (gst_buffer_ref (its_key)), trial (its_key)
  {
  }
  ~Gate () { gst_buffer_unref (key); }

  GstElement *element; /* the srtpdec behind it */
  GstBuffer *key;
  /* The two sinks may have threads of their own. srtpdec asks for keys with its object lock held,
   * and takes that lock in clear-keys, which is never called with `lock` held. */
  std::mutex trial_lock;
  SrtpTrial trial; /* under trial_lock */
  std::mutex lock; /* guards what follows */
  std::vector<Known> known;
  guint64 uses = 0;
};

/* What is known of a packet's sender before it goes in. RTCP of one that is known by RTP alone may
 * go in, too: the srtpdec checks it. */
struct Before {
  bool known = false;  /* has shown that it has the key; where it is RTP, by RTP */
  bool old = false;    /* the packet may be a replay */
  bool closed = false; /* its packets can no longer be decrypted */
  bool gone = false;   /* for kGoneTimeUs: it may have started over */
  guint roll_over = 0; /* probably */
};

/* Nothing for other packets. RFC 5761, 4 distinguishes RTP and RTCP. */
std::optional<guint32>
ssrc_of (GstBuffer *buffer, bool is_rtcp)
{
  guint8 header[12] = {};
  const gsize size = gst_buffer_extract (buffer, 0, header, sizeof header);
  if (size < sizeof header || header[0] >> 6 != 2)
    return std::nullopt;
  const int type = header[1] & 0x7f;
  const bool may_be_rtcp = type >= 64 && type <= 95;
  if (is_rtcp != may_be_rtcp)
    return std::nullopt;
  return GST_READ_UINT32_BE (header + (is_rtcp ? 4 : 8));
}

guint16
sequence_of (GstBuffer *buffer)
{
  guint8 bytes[2] = {};
  gst_buffer_extract (buffer, 2, bytes, sizeof bytes);
  return GST_READ_UINT16_BE (bytes);
}

/* As srtpdec guesses it: that nearest to the largest one. RFC 3711, 3.3.1. */
gint64
guess_index (gint64 largest, guint16 sequence)
{
  return largest <= 0x8000 ? sequence : largest + gint16 (guint16 (sequence - largest));
}

/* Under the lock. */
Known *
find (Gate &gate, guint32 ssrc)
{
  const auto known = std::ranges::find (gate.known, ssrc, &Known::ssrc);
  return known == gate.known.end () ? nullptr : &*known;
}

/* Only clear-keys frees memory of srtpdec, which then asks for all keys again. It also loses the
 * replay windows, so packets before the largest index are dropped from now on. */
void
remove_idle (Gate &gate, std::size_t kept)
{
  {
    const std::lock_guard guard (gate.lock);
    std::ranges::sort (gate.known, std::ranges::greater (), &Known::use);
    gate.known.resize (std::min (gate.known.size (), kept));
    for (Known &known : gate.known) {
      known.asked = false;
      known.floor = known.index.value_or (-1);
    }
  }
  g_signal_emit_by_name (gate.element, "clear-keys");
}

Before
look_up (Gate &gate, guint32 ssrc, GstBuffer *buffer, bool is_rtcp)
{
  const gint64 now_us = g_get_monotonic_time ();
  const std::lock_guard guard (gate.lock);
  Known *const known = find (gate, ssrc);
  if (!known || (!is_rtcp && !known->index))
    return {};
  known->use = ++gate.uses;
  Before before = {.known = true};
  if (is_rtcp)
    return before;
  const gint64 index = guess_index (*known->index, sequence_of (buffer));
  known->roll_over = guint (index >> 16);
  known->closed++;
  before.old = index <= known->floor;
  const gint64 silent_us = now_us - known->opened_us;
  before.closed =
      known->closed >= kClosedPackets && (silent_us >= kClosedTimeUs || known->started_over ());
  before.gone = before.closed && silent_us >= kGoneTimeUs;
  before.roll_over = guint (known->peak >> 16);
  return before;
}

/* A sender has shown that it has the key, by this packet, which goes to the srtpdec next.
 * @param may_be_old  it has been gone for long
 * @return whether it may go: it is no replay */
bool
welcome (Gate &gate, guint32 ssrc, std::optional<gint64> index, bool may_be_old)
{
  bool again = false, many = false;
  {
    const std::lock_guard guard (gate.lock);
    const Known *const known = find (gate, ssrc);
    if (index && known && *index <= known->peak && !may_be_old)
      return false;
    again = known && known->asked && index;
    many = !known && gate.known.size () >= kMaxKnown;
  }
  if (again || many)
    remove_idle (gate, many ? kKept : kMaxKnown);
  const std::lock_guard guard (gate.lock);
  Known *known = find (gate, ssrc);
  if (!known)
    known = &gate.known.emplace_back (Known{.ssrc = ssrc});
  known->use = ++gate.uses;
  if (!index)
    return true;
  known->floor = known->index ? *index - 1 : -1;
  known->index = index;
  known->peak = std::max (known->peak, *index);
  known->roll_over = guint (*index >> 16);
  known->closed = 0;
  known->opened_us = g_get_monotonic_time ();
  return true;
}

/* The index of a packet that is genuine; of others nothing. */
std::optional<gint64>
try_rtp (Gate &gate, guint32 ssrc, GstBuffer *buffer, const Before &before)
{
  const std::lock_guard guard (gate.trial_lock);
  std::optional<guint> roll_over;
  if (!before.known && gate.trial.opens_rtp (buffer))
    roll_over = 0;
  else
    roll_over = gate.trial.roll_over_of (buffer, ssrc, before.roll_over, before.gone);
  if (!roll_over)
    return std::nullopt;
  return gint64 (*roll_over) << 16 | sequence_of (buffer);
}

/* A sender that is known, or has just shown that it has the key. */
bool
may_pass (Gate &gate, GstBuffer *buffer, bool is_rtcp)
{
  const auto ssrc = ssrc_of (buffer, is_rtcp);
  if (!ssrc)
    return false;
  const Before before = look_up (gate, *ssrc, buffer, is_rtcp);
  if (before.known && !before.closed)
    return !before.old;
  if (is_rtcp) {
    {
      const std::lock_guard guard (gate.trial_lock);
      if (!gate.trial.opens_rtcp (buffer))
        return false;
    }
    return welcome (gate, *ssrc, std::nullopt, false);
  }
  if (const auto index = try_rtp (gate, *ssrc, buffer, before))
    return welcome (gate, *ssrc, index, before.gone);
  return before.known && !before.old; /* it may be where the srtpdec believes it */
}

/* A packet is genuine and no replay. */
GstPadProbeReturn
on_opened (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto &gate = *static_cast<Gate *> (user_data);
  GstBuffer *const buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  const auto ssrc = ssrc_of (buffer, false);
  const std::lock_guard guard (gate.lock);
  Known *const known = ssrc ? find (gate, *ssrc) : nullptr;
  if (known && known->index) {
    known->index = std::max (*known->index, guess_index (*known->index, sequence_of (buffer)));
    known->peak = std::max (known->peak, *known->index);
    /* Undecryptable packets add up even if replays come between them. */
    known->closed = known->started_over () ? known->closed - std::min (known->closed, 1U) : 0;
    known->opened_us = g_get_monotonic_time ();
  }
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn
on_rtp (GstPad *, GstPadProbeInfo *info, gpointer gate)
{
  return may_pass (*static_cast<Gate *> (gate), GST_PAD_PROBE_INFO_BUFFER (info), false)
             ? GST_PAD_PROBE_OK
             : GST_PAD_PROBE_DROP;
}

GstPadProbeReturn
on_rtcp (GstPad *, GstPadProbeInfo *info, gpointer gate)
{
  return may_pass (*static_cast<Gate *> (gate), GST_PAD_PROBE_INFO_BUFFER (info), true)
             ? GST_PAD_PROBE_OK
             : GST_PAD_PROBE_DROP;
}

GstCaps *
on_key (GstElement *, guint ssrc, gpointer user_data)
{
  auto &gate = *static_cast<Gate *> (user_data);
  const std::lock_guard guard (gate.lock);
  Known *const known = find (gate, ssrc);
  if (!known)
    return nullptr;
  known->asked = true;
  return srtp_caps (ssrc, gate.key, known->roll_over);
}

} // namespace

bool
add_srtp_gate (GstElement *decrypter, GstBuffer *key)
{
  auto gate = new Gate (decrypter, key);
  g_object_set_data_full (G_OBJECT (decrypter), "rangecast-srtp-gate", gate,
      [] (gpointer data) { delete static_cast<Gate *> (data); });
  if (!gate->trial.ready ())
    return false;
  g_signal_connect (decrypter, "request-key", G_CALLBACK (on_key), gate);
  GstPad *rtp = gst_element_get_static_pad (decrypter, "rtp_sink");
  GstPad *rtcp = gst_element_get_static_pad (decrypter, "rtcp_sink");
  gst_pad_add_probe (rtp, GST_PAD_PROBE_TYPE_BUFFER, on_rtp, gate, nullptr);
  gst_pad_add_probe (rtcp, GST_PAD_PROBE_TYPE_BUFFER, on_rtcp, gate, nullptr);
  GstPad *opened = gst_element_get_static_pad (decrypter, "rtp_src");
  gst_pad_add_probe (opened, GST_PAD_PROBE_TYPE_BUFFER, on_opened, gate, nullptr);
  gst_object_unref (opened);
  gst_object_unref (rtcp);
  gst_object_unref (rtp);
  return true;
}
