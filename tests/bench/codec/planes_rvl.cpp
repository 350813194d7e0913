/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* RVL, and RVL packed once more. Runs of zeros and of values, zigzag differences, in nibbles of
 * three bits of a number and a bit whether more follow; eight nibbles a word, the first highest. */
#include <algorithm>
#include <cstring>

#include "planes.hpp"

#if HAVE_ZSTD
#include <zstd.h>
#endif

using namespace rangecast;

namespace bench {
namespace {

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

#if HAVE_ZSTD
class RvlZstd final : public PlaneCode {
public:
  RvlZstd () : packer_ (ZSTD_createCCtx ()), unpacker_ (ZSTD_createDCtx ()) {}
  ~RvlZstd () override
  {
    ZSTD_freeCCtx (packer_);
    ZSTD_freeDCtx (unpacker_);
  }
  RvlZstd (const RvlZstd &) = delete;
  RvlZstd &operator= (const RvlZstd &) = delete;

  Status encode (const Picture &from, Bytes &to) override
  {
    if (Status s = rvl_.encode (from, nibbles_); !s.ok ())
      return s;
    const std::size_t most = ZSTD_compressBound (nibbles_.size);
    to.size =
        ZSTD_compressCCtx (packer_, to.need (most), most, nibbles_.room.data (), nibbles_.size, 1);
    if (ZSTD_isError (to.size))
      return {StatusCode::kBadData, ZSTD_getErrorName (to.size)};
    return {};
  }

  Status decode (std::span<const std::uint8_t> from, Picture &to) override
  {
    const unsigned long long size = ZSTD_getFrameContentSize (from.data (), from.size ());
    if (size > 4 * to.depth.size () + 64)
      return {StatusCode::kBadData, "zstd: more bytes than RVL makes"};
    nibbles_.size =
        ZSTD_decompressDCtx (unpacker_, nibbles_.need (size), size, from.data (), from.size ());
    if (ZSTD_isError (nibbles_.size))
      return {StatusCode::kBadData, ZSTD_getErrorName (nibbles_.size)};
    return rvl_.decode (nibbles_.used (), to);
  }

private:
  Rvl rvl_;
  Bytes nibbles_;
  ZSTD_CCtx *packer_;
  ZSTD_DCtx *unpacker_;
};
#endif

} // namespace

std::unique_ptr<PlaneCode>
make_rvl ()
{
  return std::make_unique<Rvl> ();
}

std::unique_ptr<PlaneCode>
make_rvl_zstd ()
{
#if HAVE_ZSTD
  return std::make_unique<RvlZstd> ();
#else
  return nullptr;
#endif
}

} // namespace bench
