/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What people send RGB-D pictures with: RVL for depth and JPEG for colour. */
#include <turbojpeg.h>

#include <algorithm>
#include <cstring>

#include "codec.hpp"

using namespace rangecast;

namespace bench {
namespace {

/** Bytes of a code, in room that is kept and not cleared from picture to picture. */
struct Bytes {
  std::vector<std::uint8_t> room;
  std::size_t size = 0; ///< of the code, at the beginning of the room

  std::uint8_t *need (std::size_t most)
  {
    if (room.size () < most)
      room.resize (most);
    return room.data ();
  }
  [[nodiscard]] std::span<const std::uint8_t> used () const { return {room.data (), size}; }
};

/** Codes one plane of pictures. */
class PlaneCode {
public:
  virtual ~PlaneCode () = default;
  virtual rangecast::Status encode (const Picture &from, Bytes &to) = 0;
  virtual rangecast::Status decode (std::span<const std::uint8_t> from, Picture &to) = 0;
};

/* RVL, A. D. Wilson's lossless code of depth ("Fast lossless depth image compression", ISS 2017),
 * written from its description: runs of zeros and of values, zigzag differences, in nibbles of
 * three bits of a number and a bit whether more follow; eight nibbles a word, the first highest. */
class NibbleWriter {
public:
  /* `to` has room for all words. */
  explicit NibbleWriter (std::uint8_t *to) : to_ (to) {}

  void put (std::uint32_t value)
  {
    do {
      const std::uint32_t nibble = (value & 7) | (value > 7 ? 8 : 0);
      value >>= 3;
      word_ = word_ << 4 | nibble;
      if (++nibbles_ == 8)
        flush ();
    } while (value);
  }
  /* Fills the last word. @return behind it */
  std::uint8_t *finish ()
  {
    if (nibbles_) {
      word_ <<= 4 * (8 - nibbles_);
      flush ();
    }
    return to_;
  }

private:
  void flush ()
  {
    std::memcpy (to_, &word_, sizeof word_);
    to_ += sizeof word_;
    word_ = 0;
    nibbles_ = 0;
  }
  std::uint8_t *to_;
  std::uint32_t word_ = 0;
  int nibbles_ = 0;
};

class NibbleReader {
public:
  explicit NibbleReader (std::span<const std::uint8_t> from) : from_ (from) {}

  std::uint32_t get ()
  {
    std::uint32_t value = 0, nibble;
    int shift = 0;
    do {
      if (!nibbles_ && !next ())
        return 0;
      nibble = word_ >> 28;
      word_ <<= 4;
      nibbles_--;
      value |= (nibble & 7) << shift;
      shift += 3;
    } while (nibble & 8 && shift < 32);
    return value;
  }
  [[nodiscard]] bool ended () const { return ended_; }

private:
  bool next ()
  {
    if (from_.size () < sizeof word_) {
      ended_ = true;
      return false;
    }
    std::memcpy (&word_, from_.data (), sizeof word_);
    from_ = from_.subspan (sizeof word_);
    nibbles_ = 8;
    return true;
  }
  std::span<const std::uint8_t> from_;
  std::uint32_t word_ = 0;
  int nibbles_ = 0;
  bool ended_ = false;
};

class Rvl final : public PlaneCode {
public:
  Status encode (const Picture &from, Bytes &to) override
  {
    const std::vector<std::uint16_t> &depth = from.depth;
    /* A value takes 6 nibbles at most; a run of one value and one zero as much as both. */
    NibbleWriter nibbles (to.need (4 * depth.size () + 64));
    int previous = 0;
    for (std::size_t i = 0; i < depth.size ();) {
      std::size_t zeros = i;
      while (zeros < depth.size () && !depth[zeros])
        zeros++;
      std::size_t end = zeros;
      while (end < depth.size () && depth[end])
        end++;
      nibbles.put (std::uint32_t (zeros - i));
      nibbles.put (std::uint32_t (end - zeros));
      for (i = zeros; i < end; i++) {
        const int delta = depth[i] - previous;
        nibbles.put (std::uint32_t (delta << 1 ^ delta >> 31));
        previous = depth[i];
      }
    }
    to.size = std::size_t (nibbles.finish () - to.room.data ());
    return {};
  }

  Status decode (std::span<const std::uint8_t> from, Picture &to) override
  {
    NibbleReader nibbles (from);
    std::uint16_t *depth = to.depth.data ();
    std::size_t left = to.depth.size ();
    int previous = 0;
    while (left && !nibbles.ended ()) {
      const std::size_t zeros = nibbles.get (), values = nibbles.get ();
      if (zeros > left || values > left - zeros)
        return {StatusCode::kBadData, "RVL: more pixels than there are"};
      std::fill_n (depth, zeros, std::uint16_t{0});
      depth += zeros;
      for (std::size_t i = 0; i < values; i++) {
        const std::uint32_t z = nibbles.get ();
        previous += int (z >> 1) ^ -int (z & 1);
        *depth++ = std::uint16_t (previous);
      }
      left -= zeros + values;
    }
    return nibbles.ended () ? Status{StatusCode::kTruncated, "RVL: ends early"} : Status{};
  }
};

/* libjpeg-turbo, 4:2:0, its accurate DCT: 1 to 3 % slower than the fast one and 0.3 to 1 dB better.
 */
class Jpeg final : public PlaneCode {
public:
  explicit Jpeg (int quality)
      : quality_ (quality), packer_ (tjInitCompress ()), unpacker_ (tjInitDecompress ())
  {
  }
  ~Jpeg () override
  {
    tjDestroy (packer_);
    tjDestroy (unpacker_);
  }
  Jpeg (const Jpeg &) = delete;
  Jpeg &operator= (const Jpeg &) = delete;

  Status encode (const Picture &from, Bytes &to) override
  {
    const unsigned long most = tjBufSize (from.width, from.height, TJSAMP_420);
    unsigned char *at = to.need (most);
    unsigned long size = most;
    if (tjCompress2 (packer_, &from.colour[0].r, from.width, 0, from.height, TJPF_RGBX, &at, &size,
            TJSAMP_420, quality_, TJFLAG_ACCURATEDCT | TJFLAG_NOREALLOC))
      return {StatusCode::kBadData, tjGetErrorStr2 (packer_)};
    to.size = size;
    return {};
  }

  Status decode (std::span<const std::uint8_t> from, Picture &to) override
  {
    if (tjDecompress2 (unpacker_, from.data (), from.size (), &to.colour[0].r, to.width, 0,
            to.height, TJPF_RGBX, TJFLAG_ACCURATEDCT))
      return {StatusCode::kBadData, tjGetErrorStr2 (unpacker_)};
    return {};
  }

private:
  int quality_;
  tjhandle packer_, unpacker_;
};

class Pair final : public Codec {
public:
  explicit Pair (int quality)
      : Codec (kPeerName, "JPEG 4:2:0 q" + std::to_string (quality)),
        depth_ (std::make_unique<Rvl> ()), colour_ (std::make_unique<Jpeg> (quality))
  {
  }

  Status encode (FrameSet &set) override
  {
    coded_.resize (2 * set.size ());
    for (std::size_t i = 0; i < set.size (); i++) {
      const Picture &picture = set[i].person;
      if (Status s = depth_->encode (picture, coded_[2 * i]); !s.ok ())
        return s;
      if (Status s = colour_->encode (picture, coded_[2 * i + 1]); !s.ok ())
        return s;
    }
    return {};
  }

  void collect (Coded &to) const override
  {
    to.resize (coded_.size ());
    for (std::size_t i = 0; i < to.size (); i++)
      to[i].assign (coded_[i].used ().begin (), coded_[i].used ().end ());
  }

  Status decode (const Coded &from, std::vector<Picture> &pictures) override
  {
    for (std::size_t i = 0; i < pictures.size (); i++) {
      if (Status s = depth_->decode (from[2 * i], pictures[i]); !s.ok ())
        return s;
      if (Status s = colour_->decode (from[2 * i + 1], pictures[i]); !s.ok ())
        return s;
    }
    return {};
  }

private:
  std::unique_ptr<PlaneCode> depth_, colour_;
  std::vector<Bytes> coded_;
};

} // namespace

std::unique_ptr<Codec>
make_peer (int quality)
{
  return std::make_unique<Pair> (quality);
}

} // namespace bench
