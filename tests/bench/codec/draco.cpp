/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Draco's point clouds. Points are what the pixels are in the view's own coordinates, in the order
 * of the pixels, which the sequential method keeps. */
#include "codec.hpp"

#if HAVE_DRACO
#include <algorithm>
#include <cmath>
#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/point_cloud/point_cloud_builder.h>
#endif

using namespace rangecast;

namespace bench {

#if HAVE_DRACO
namespace {

constexpr int kPositionBits = 11;

class Draco final : public Codec {
public:
  explicit Draco (const Rig &rig)
      : Codec ("Draco", "sequential, positions 11 bits, colour exact", false), rig_ (rig)
  {
    encoder_.SetEncodingMethod (draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
    encoder_.SetAttributeQuantization (draco::GeometryAttribute::POSITION, kPositionBits);
  }

  Status encode (FrameSet &set) override
  {
    buffers_.resize (set.size ());
    for (std::size_t i = 0; i < set.size (); i++) {
      const std::unique_ptr<draco::PointCloud> cloud = make_cloud (set[i]);
      buffers_[i].Clear ();
      if (const draco::Status s = encoder_.EncodePointCloudToBuffer (*cloud, &buffers_[i]);
          !s.ok ())
        return {StatusCode::kBadData, s.error_msg_string ()};
    }
    return {};
  }

  void collect (Coded &to) const override
  {
    to.resize (buffers_.size ());
    for (std::size_t i = 0; i < to.size (); i++)
      to[i].assign (buffers_[i].data (), buffers_[i].data () + buffers_[i].size ());
  }

  Status decode (const Coded &from, std::vector<Picture> &) override
  {
    clouds_.resize (from.size ());
    for (std::size_t i = 0; i < from.size (); i++) {
      draco::DecoderBuffer buffer;
      buffer.Init (reinterpret_cast<const char *> (from[i].data ()), from[i].size ());
      draco::Decoder decoder;
      auto cloud = decoder.DecodePointCloudFromBuffer (&buffer);
      if (!cloud.ok ())
        return {StatusCode::kBadData, cloud.status ().error_msg_string ()};
      clouds_[i] = std::move (cloud).value ();
    }
    return {};
  }

  Status finish (const FrameSet &set, std::vector<Picture> &pictures) override
  {
    for (std::size_t i = 0; i < set.size (); i++) {
      const auto *positions = clouds_[i]->GetNamedAttribute (draco::GeometryAttribute::POSITION);
      const auto *colours = clouds_[i]->GetNamedAttribute (draco::GeometryAttribute::COLOR);
      const double unit = rig_.find (set[i].view_id)->depth_unit_m;
      Picture &to = pictures[i];
      draco::PointIndex point (0);
      for (std::size_t p = 0; p < to.depth.size (); p++) {
        to.depth[p] = 0;
        if (!set[i].person.depth[p])
          continue;
        if (point >= clouds_[i]->num_points ())
          return {StatusCode::kBadData, "points are missing"};
        float xyz[3];
        positions->GetMappedValue (point, xyz);
        to.depth[p] = std::uint16_t (std::clamp (std::round (xyz[2] / unit), 1.0, 65535.0));
        colours->GetMappedValue (point, &to.colour[p].r);
        ++point;
      }
    }
    return {};
  }

private:
  std::unique_ptr<draco::PointCloud> make_cloud (const ViewPictures &view) const
  {
    const View &camera = *rig_.find (view.view_id);
    const Picture &from = view.person;
    const auto points =
        from.depth.size () - std::size_t (std::ranges::count (from.depth, std::uint16_t{0}));
    draco::PointCloudBuilder builder;
    builder.Start (draco::PointIndex::ValueType (points));
    const int position =
        builder.AddAttribute (draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    const int colour = builder.AddAttribute (draco::GeometryAttribute::COLOR, 3, draco::DT_UINT8);
    draco::PointIndex point (0);
    std::size_t i = 0;
    for (int y = 0; y < from.height; y++)
      for (int x = 0; x < from.width; x++, i++) {
        if (!from.depth[i])
          continue;
        const Vec3 p = camera.intrinsics.unproject (
            view.roi.x + x, view.roi.y + y, from.depth[i] * camera.depth_unit_m);
        const float xyz[3] = {float (p.x), float (p.y), float (p.z)};
        builder.SetAttributeValueForPoint (position, point, xyz);
        builder.SetAttributeValueForPoint (colour, point, &from.colour[i].r);
        ++point;
      }
    return builder.Finalize (false);
  }

  Rig rig_;
  draco::Encoder encoder_;
  std::vector<draco::EncoderBuffer> buffers_;
  std::vector<std::unique_ptr<draco::PointCloud>> clouds_;
};

} // namespace

std::unique_ptr<Codec>
make_draco (const Rig &rig)
{
  return std::make_unique<Draco> (rig);
}

#else

std::unique_ptr<Codec>
make_draco (const Rig &)
{
  return nullptr;
}

#endif

} // namespace bench
