/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

#include <array>

/** Whether both are the same address and port; unknown ones (null) are the same. */
bool same_sender (GSocketAddress *a, GSocketAddress *b);

/** Probation, before a sender is accepted: a source passes with kPackets valid packets with
 *  consecutive sequence numbers. They are kept, so that none is lost.
 *
 *  When all places are taken, a new candidate replaces, in this order: one that was silent for
 *  kStale; one of its own host, if that has kPerHost places; any other. Among these it is the one
 *  with the fewest packets, then the one silent for longest. So a flood from one host never removes
 *  a candidate of another host, and no flood of ever new sources one with two packets. */
class SenderProbation {
public:
  static constexpr std::size_t kPackets = 4;
  static constexpr std::size_t kCandidates = 64; ///< at a time
  static constexpr std::ptrdiff_t kPerHost = 16; ///< at one address, with any port
  static constexpr GstClockTime kStale = 5 * GST_SECOND;

  struct Packet {
    GSocketAddress *address; ///< may be null; not owned
    guint32 ssrc;
    guint16 sequence;
    int version; ///< of the neighbour code
    GstClockTime time;
  };

  /** References to packets, in order. It has no destructor: the owner calls unref(). */
  class Stream {
  public:
    [[nodiscard]] std::size_t size () const { return size_; }
    [[nodiscard]] bool empty () const { return size_ == 0; }
    GstBuffer **begin () { return packets_.data (); }
    GstBuffer **end () { return begin () + size_; }
    /** Call it only with fewer than kPackets. */
    void push (GstBuffer *packet) { packets_[size_++] = packet; }
    /** Clears it without unref: the references were given away. */
    void release () { size_ = 0; }
    void unref ();

  private:
    std::array<GstBuffer *, kPackets> packets_;
    std::size_t size_ = 0;
  };

  SenderProbation () = default;
  ~SenderProbation () { clear (); }
  SenderProbation (const SenderProbation &) = delete;

  void clear ();
  /** Records a packet.
   *  @param buffer  (transfer none)
   *  @param[out] stream  if the source has passed: its packets including this one, (transfer full)
   *  @return whether the source has passed */
  bool add (const Packet &packet, GstBuffer *buffer, Stream &stream);

private:
  struct Candidate {
    GSocketAddress *address = nullptr; /* a reference */
    guint32 ssrc = 0;
    guint16 sequence = 0; /* of the last packet */
    int version = 0;
    GstClockTime heard = 0; /* time of the last packet */
    guint64 used = 0;       /* order of last use; 0: free */
    Stream packets;

    void clear ();
  };

  Candidate &find (const Packet &packet);
  Candidate &make_room (const Packet &packet);

  std::array<Candidate, kCandidates> candidates_;
  guint64 uses_ = 0;
};
