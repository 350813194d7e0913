/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <turbojpeg.h>

#include "planes.hpp"

using namespace rangecast;

namespace bench {
namespace {

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

} // namespace

std::unique_ptr<PlaneCode>
make_jpeg (int quality)
{
  return std::make_unique<Jpeg> (quality);
}

} // namespace bench
