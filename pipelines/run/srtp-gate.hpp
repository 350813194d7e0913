/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Protects a srtpdec from packets of senders that do not have the key. */
#pragma once

#include <gst/gst.h>

/** Lets only packets of SSRCs that sent an authentic packet pass to a srtpdec.
 *
 *  srtpdec 1.22 asks for a key for each new SSRC, before it can know whether the packet is
 *  authentic, keeps 29 KB for each, does not free them in remove-key, and searches all of them
 *  for each packet. So packets of unknown SSRCs are first tried with another srtpdec, which is
 *  cleared before each trial: at most 200 a second (0.1 ms each). Other packets are dropped;
 *  later ones of a genuine sender are tried. Of more than 256 authenticated SSRCs, those that
 *  were silent longest are removed.
 *
 *  SrtpTrial finds a sender's roll-over counter (RFC 3711, 3.3.1), also when packets of a known
 *  sender stop authenticating: beyond its largest index, and after 10 s anywhere. Once the
 *  srtpdec was cleared, packets before the largest index are dropped as replays.
 *
 *  RTP on rtp_sink and SRTCP on rtcp_sink; a srtpdec should have one of them in use.
 *  @param decrypter  in NULL or READY; owns the gate
 *  @param key  16 bytes of key, 14 of salt (AES-128 in counter mode, HMAC-SHA1 of 80 bits)
 *  @return false if there is no srtpdec for the trials */
[[nodiscard]] bool add_srtp_gate (GstElement *decrypter, GstBuffer *key);
