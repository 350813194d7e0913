/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Whether packets of SRTP are genuine, without the srtpdec that is to open them. */
#pragma once

#include <gst/gst.h>

#include <array>
#include <optional>

/** Caps for srtpdec's request-key: AES-128 in counter mode, HMAC-SHA1 of 80 bits.
 *  @param roll_over  of the sequence number of the stream's next packet (RFC 3711, 3.3.1) */
GstCaps *srtp_caps (guint32 ssrc, GstBuffer *key, guint roll_over);

/** So many tries a second in the long run, and 32 at once. */
class SrtpTries {
public:
  explicit SrtpTries (gint64 time_us) : time_us_ (time_us) {}
  /** @return whether one may be done now; it counts as done */
  bool take ();

private:
  gint64 time_us_, next_us_ = 0;
};

/** Tells genuine packets from others, by a srtpdec of its own that keeps nothing.
 *
 *  A packet of RTP does not say how often its sender's sequence numbers have started over, and
 *  opens only with that number. Each SSRC that goes on sending has one number after the other
 *  tried, 16 from its first one, then 256, then 4096, and again: 400 a second in all, in equal
 *  parts for all such SSRCs. A flood with an SSRC for each packet has no part in it. */
class SrtpTrial {
public:
  static constexpr guint kMaxRollOvers = 4096;

  /** @param key  16 bytes of key, 14 of salt */
  explicit SrtpTrial (GstBuffer *key);
  ~SrtpTrial ();
  SrtpTrial (const SrtpTrial &) = delete;
  /** @return whether there is a srtpdec */
  [[nodiscard]] bool ready () const { return decrypter_ != nullptr; }

  /** A packet of SRTCP, which says its number; 200 a second are tried.
   *  @return whether it is genuine; not, where there were too many to try */
  bool opens_rtcp (GstBuffer *buffer);
  /** A packet of RTP of a sender who has just begun, as most do; 200 a second are tried. */
  bool opens_rtp (GstBuffer *buffer);
  /** A packet of RTP with any roll-over counter.
   *  @param first  tried before larger ones
   *  @param from_zero  look from 0 on, too, every other time
   *  @return that which it opened with; nothing while it is being looked for, or if it is not
   *  genuine */
  std::optional<guint> roll_over_of (
      GstBuffer *buffer, guint32 ssrc, guint first = 0, bool from_zero = false);

private:
  /* An SSRC whose roll-over counter is looked for. */
  struct Seeker {
    guint32 ssrc = 0;
    guint credit = 0; /* its packets, less those of others with the same place */
    guint round = 0, next = 0;
    gint64 seen_us = 0, next_try_us = 0;
  };

  Seeker *place_of (guint32 ssrc, gint64 now_us);
  [[nodiscard]] gint64 count_seekers (gint64 now_us) const;
  bool try_one (const char *pad, GstBuffer *buffer, guint roll_over);
  static GstCaps *on_key (GstElement *, guint ssrc, gpointer trial);

  GstElement *decrypter_;
  GstBuffer *key_;
  guint roll_over_ = 0; /* of the try that is being done */
  bool opened_ = false;
  SrtpTries first_tries_, more_tries_;
  guint32 scatter_; /* an odd random number, so that senders cannot choose places */
  std::array<Seeker, 1024> seekers_;
};
