/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "srtp-trial.hpp"

#include <algorithm>

namespace {

constexpr gint64 kAtOnce = 32;           /* tries; one takes 0.1 ms */
constexpr gint64 kFirstTryTimeUs = 5000; /* between tries, in the long run: of new SSRCs, ... */
constexpr gint64 kMoreTryTimeUs = 2500;  /* ... of roll-over counters */
constexpr guint kOfRound[] = {16, 256, SrtpTrial::kMaxRollOvers}; /* counters of a round */
constexpr guint kNeededCredit = 3, kMaxCredit = 64;
constexpr gint64 kSeekerTimeUs = 1'000'000; /* without a packet: it is gone */
constexpr int kPlaceBits = 10;

GstPadProbeReturn
on_opened (GstPad *, GstPadProbeInfo *, gpointer opened)
{
  *static_cast<bool *> (opened) = true;
  return GST_PAD_PROBE_DROP;
}

} // namespace

GstCaps *
srtp_caps (guint32 ssrc, GstBuffer *key, guint roll_over)
{
  return gst_caps_new_simple ("application/x-srtp", "ssrc", G_TYPE_UINT, ssrc, "srtp-key",
      GST_TYPE_BUFFER, key, "srtp-cipher", G_TYPE_STRING, "aes-128-icm", "srtp-auth", G_TYPE_STRING,
      "hmac-sha1-80", "srtcp-cipher", G_TYPE_STRING, "aes-128-icm", "srtcp-auth", G_TYPE_STRING,
      "hmac-sha1-80", "roc", G_TYPE_UINT, roll_over, nullptr);
}

bool
SrtpTries::take ()
{
  const gint64 now_us = g_get_monotonic_time ();
  next_us_ = std::max (next_us_, now_us - time_us_ * kAtOnce);
  if (next_us_ > now_us)
    return false;
  next_us_ += time_us_;
  return true;
}

GstCaps *
SrtpTrial::on_key (GstElement *, guint ssrc, gpointer trial)
{
  const auto &self = *static_cast<SrtpTrial *> (trial);
  return srtp_caps (ssrc, self.key_, self.roll_over_);
}

SrtpTrial::SrtpTrial (GstBuffer *key)
    : decrypter_ (gst_element_factory_make ("srtpdec", nullptr)), key_ (gst_buffer_ref (key)),
      first_tries_ (kFirstTryTimeUs), more_tries_ (kMoreTryTimeUs), scatter_ (g_random_int () | 1)
{
  if (!decrypter_)
    return;
  gst_object_ref_sink (decrypter_);
  g_signal_connect (decrypter_, "request-key", G_CALLBACK (on_key), this);
  for (const char *name : {"rtp_src", "rtcp_src"}) {
    GstPad *pad = gst_element_get_static_pad (decrypter_, name);
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, on_opened, &opened_, nullptr);
    gst_object_unref (pad);
  }
  gst_element_set_state (decrypter_, GST_STATE_PLAYING);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  for (const char *name : {"rtp_sink", "rtcp_sink"}) {
    GstPad *pad = gst_element_get_static_pad (decrypter_, name);
    gst_pad_send_event (pad, gst_event_new_stream_start (name));
    GstCaps *caps = gst_pad_get_pad_template_caps (pad);
    gst_pad_send_event (pad, gst_event_new_caps (caps));
    gst_caps_unref (caps);
    gst_pad_send_event (pad, gst_event_new_segment (&segment));
    gst_object_unref (pad);
  }
}

SrtpTrial::~SrtpTrial ()
{
  if (decrypter_)
    gst_element_set_state (decrypter_, GST_STATE_NULL);
  gst_clear_object (&decrypter_);
  gst_buffer_unref (key_);
}

/* A stream's counter is asked for only once, and its packets count as replayed later, so
 * every trial begins by clearing the keys. */
bool
SrtpTrial::try_one (const char *pad, GstBuffer *buffer, guint roll_over)
{
  g_signal_emit_by_name (decrypter_, "clear-keys");
  roll_over_ = roll_over;
  opened_ = false;
  GstPad *sink = gst_element_get_static_pad (decrypter_, pad);
  gst_pad_chain (sink, gst_buffer_copy_deep (buffer)); /* it is decrypted where it is */
  gst_object_unref (sink);
  return opened_;
}

bool
SrtpTrial::opens_rtcp (GstBuffer *buffer)
{
  return first_tries_.take () && try_one ("rtcp_sink", buffer, 0);
}

bool
SrtpTrial::opens_rtp (GstBuffer *buffer)
{
  return first_tries_.take () && try_one ("rtp_sink", buffer, 0);
}

/* Whoever sends most at a place has it, after a while: a flood of many SSRCs goes to all places, a
 * sender to one. */
SrtpTrial::Seeker *
SrtpTrial::place_of (guint32 ssrc, gint64 now_us)
{
  Seeker &place = seekers_[guint32 (ssrc * scatter_) >> (32 - kPlaceBits)];
  static_assert (std::tuple_size_v<decltype (seekers_)> == 1 << kPlaceBits);
  if (place.ssrc != ssrc || place.seen_us == 0) {
    if (place.credit > 0 && now_us - place.seen_us < kSeekerTimeUs) {
      place.credit--;
      return nullptr;
    }
    place = {.ssrc = ssrc};
  }
  place.seen_us = now_us;
  place.credit = std::min (place.credit + 1, kMaxCredit);
  return place.credit < kNeededCredit ? nullptr : &place;
}

gint64
SrtpTrial::count_seekers (gint64 now_us) const
{
  return std::ranges::count_if (seekers_, [now_us] (const Seeker &seeker) {
    return seeker.credit >= kNeededCredit && now_us - seeker.seen_us < kSeekerTimeUs;
  });
}

std::optional<guint>
SrtpTrial::roll_over_of (GstBuffer *buffer, guint32 ssrc, guint first, bool from_zero)
{
  const gint64 now_us = g_get_monotonic_time ();
  Seeker *const seeker = place_of (ssrc, now_us);
  if (!seeker || seeker->next_try_us > now_us)
    return std::nullopt;
  const gint64 time_us = kMoreTryTimeUs * count_seekers (now_us);
  seeker->next_try_us = std::max (seeker->next_try_us, now_us - time_us * kAtOnce);
  while (seeker->next_try_us <= now_us && more_tries_.take ()) {
    seeker->next_try_us += time_us;
    const guint roll_over = (from_zero && seeker->round % 2 ? 0 : first) + seeker->next;
    if (try_one ("rtp_sink", buffer, roll_over)) {
      *seeker = {};
      return roll_over;
    }
    const guint of_round = kOfRound[seeker->round % std::size (kOfRound)];
    if (++seeker->next < of_round)
      continue;
    seeker->next = 0;
    seeker->round++;
    if (of_round == kMaxRollOvers)
      seeker->credit = 0; /* others may have the place now */
    break;
  }
  return std::nullopt;
}
