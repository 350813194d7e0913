/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stands before a srtpdec: packets of senders who have the key, and no others. */
#pragma once

#include <gst/gst.h>

/** Lets a srtpdec see only packets of SSRCs of which one was genuine.
 *
 *  srtpdec asks for a key for each SSRC that comes, before it can know whether the packet is
 *  genuine, and keeps 29 KB for each; its remove-key does not give them back (1.22), and it looks
 *  through all of them for each packet. So packets of an unknown SSRC are first tried with another
 *  srtpdec, which forgets all it knows before each: 200 a second at most (a try takes 0.1 ms), the
 *  others are dropped; a good sender's next ones are tried. Of those that were genuine the srtpdec
 *  itself forgets the ones that were silent for longest when there are more than 256.
 *
 *  A sender's roll-over counter (RFC 3711, 3.3.1) is found by SrtpTrial; and found again when
 *  nothing of a known sender opens any longer: only beyond its largest index, and after 10 s
 *  anywhere. When the srtpdec was made to forget, packets before the largest index are dropped.
 *
 *  RTP on rtp_sink and SRTCP on rtcp_sink; a srtpdec should have one of them in use.
 *  @param decrypter  before it plays; the gate lives as long
 *  @param key  16 bytes of key, 14 of salt (AES-128 in counter mode, HMAC-SHA1 of 80 bits)
 *  @return whether there is a gate: srtpdec is needed */
[[nodiscard]] bool add_srtp_gate (GstElement *decrypter, GstBuffer *key);
