/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

#include <array>

/** Whether both are the same address and port; unknown ones (null) are the same. */
bool same_sender (GSocketAddress *a, GSocketAddress *b);

/** Tells a stream from packets that only look like some: it has kPackets sound ones one after
 *  another in its sequence numbers. They are kept, so that nothing is lost of it.
 *
 *  Where a flood of strangers takes all places, room for somebody new is made by who was silent for
 *  kStale; else, where his own host has kPerHost places, by one of these; else by anybody: who has
 *  fewest packets, and of these the one that was silent for longest. So a flood from one host never
 *  drives out a stream of another one, nor any flood of ever new strangers one of two packets. */
class SenderProbation {
public:
  static constexpr std::size_t kPackets = 4;
  static constexpr std::size_t kCandidates = 64; ///< strangers that are known at a time
  static constexpr std::ptrdiff_t kPerHost = 16; ///< of them at one address, whatever its port
  static constexpr GstClockTime kStale = 5 * GST_SECOND;

  struct Packet {
    GSocketAddress *address; ///< may be null; not owned
    guint32 ssrc;
    guint16 sequence;
    int version; ///< of the neighbour code
    GstClockTime time;
  };

  /** Packets in order, a reference of each. Whoever takes them unrefs them: it has no destructor.
   */
  class Stream {
  public:
    [[nodiscard]] std::size_t size () const { return size_; }
    [[nodiscard]] bool empty () const { return size_ == 0; }
    GstBuffer **begin () { return packets_.data (); }
    GstBuffer **end () { return begin () + size_; }
    /** There are fewer than kPackets. */
    void push (GstBuffer *packet) { packets_[size_++] = packet; }
    /** They are somebody else's now. */
    void forget () { size_ = 0; }
    void unref ();

  private:
    std::array<GstBuffer *, kPackets> packets_;
    std::size_t size_ = 0;
  };

  SenderProbation () = default;
  ~SenderProbation () { clear (); }
  SenderProbation (const SenderProbation &) = delete;

  void clear ();
  /** Takes note of a packet.
   *  @param buffer  (transfer none)
   *  @param[out] stream  its packets so far, this one included, once it has passed: (transfer full)
   *  @return whether it has */
  bool add (const Packet &packet, GstBuffer *buffer, Stream &stream);

private:
  struct Candidate {
    GSocketAddress *address = nullptr; /* a reference */
    guint32 ssrc = 0;
    guint16 sequence = 0; /* of the last packet */
    int version = 0;
    GstClockTime heard = 0;
    guint64 used = 0; /* 0: nobody */
    Stream packets;

    void clear ();
  };

  Candidate &find (const Packet &packet);
  Candidate &make_room (const Packet &packet);

  std::array<Candidate, kCandidates> candidates_;
  guint64 uses_ = 0;
};
