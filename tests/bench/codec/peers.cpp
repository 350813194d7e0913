/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What people send RGB-D pictures with: a code for depth and one for colour. */
#include "codec.hpp"
#include "planes.hpp"

using namespace rangecast;

namespace bench {
namespace {

class Pair final : public Codec {
public:
  Pair (std::string name, std::string settings, bool whole, std::unique_ptr<PlaneCode> depth,
      std::unique_ptr<PlaneCode> colour)
      : Codec (std::move (name), std::move (settings), whole), depth_ (std::move (depth)),
        colour_ (std::move (colour))
  {
  }

  Status encode (FrameSet &set) override
  {
    coded_.resize (2 * set.size ());
    for (std::size_t i = 0; i < set.size (); i++) {
      const Picture &picture = set[i].area (whole ());
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

struct Part {
  std::string name, settings;
  std::unique_ptr<PlaneCode> code;
};

Part
make_depth (DepthCode code)
{
  switch (code) {
    case DepthCode::kRvl:
      return {"RVL", "", make_rvl ()};
    case DepthCode::kRvlZstd:
      return {"RVL + zstd", "zstd level 1", make_rvl_zstd ()};
    case DepthCode::kPngFast:
      return {"PNG16", "PNG fast", make_png_depth (PngLevel::kFast)};
    case DepthCode::kPng:
      break;
  }
  return {"PNG16", "PNG default", make_png_depth (PngLevel::kDefault)};
}

Part
make_colour (ColourCode code, int quality)
{
  switch (code) {
    case ColourCode::kJpeg:
      return {"JPEG", "JPEG 4:2:0 q" + std::to_string (quality), make_jpeg (quality)};
    case ColourCode::kPngFast:
      return {"PNG", "PNG fast", make_png_colour (PngLevel::kFast)};
    case ColourCode::kPng:
      break;
  }
  return {"PNG", "PNG default", make_png_colour (PngLevel::kDefault)};
}

} // namespace

std::unique_ptr<Codec>
make_pair (DepthCode depth_code, ColourCode colour_code, int quality, bool whole)
{
  Part depth = make_depth (depth_code), colour = make_colour (colour_code, quality);
  if (!depth.code || !colour.code)
    return nullptr;
  const std::string comma = depth.settings.empty () ? "" : ", ";
  return std::make_unique<Pair> (name_of (depth.name + " + " + colour.name, whole),
      depth.settings + comma + colour.settings, whole, std::move (depth.code),
      std::move (colour.code));
}

} // namespace bench
