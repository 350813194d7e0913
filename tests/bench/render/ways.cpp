/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ways.hpp"

#include <cmath>
#include <rangecast/render/software_renderer.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/scene_hull.hpp>

#include "truth.hpp"

using namespace rangecast;

namespace bench {
namespace {

class StripWay : public Way {
public:
  StripWay (std::string name, SurfacePainter *painter, const FrameSet &set,
      const StripSettings &settings, bool held)
      : Way (std::move (name)), painter_ (painter), set_ (set), held_ (held)
  {
    settings_.strips = settings;
    scene_.set_rig (set.rig);
  }

  void build (const Orbit &orbit) override
  {
    scene_.build (set_.images, settings_, orbit, held_);
    vertices_ = triangles_ = 0;
    for (std::size_t i = 0; i < scene_.layers ().size (); i++) {
      vertices_ += scene_.layers ()[i].vertices.size ();
      triangles_ += scene_.result (i).triangles;
    }
  }

  guint64 draw (const SurfacePicture &picture) override
  {
    SurfacePicture own = picture;
    own.mode = settings_.strips.mode;
    if (!painter_) {
      pixels_.create (picture.height, picture.width, CV_8UC4);
      renderer_.draw (own, scene_.layers (),
          {reinterpret_cast<Rgbx *> (pixels_.data), pixels_.cols, pixels_.rows,
              std::ptrdiff_t (pixels_.step)});
      return 0;
    }
    const bool uploads = uploaded_ != scene_.serial () || !held_;
    const guint64 bytes = uploads ? painter_->upload (scene_.layers ()) : 0;
    uploaded_ = scene_.serial ();
    painter_->draw (own, scene_.layers ());
    return bytes;
  }

  [[nodiscard]] const cv::Mat *own_picture () const override
  {
    return painter_ ? nullptr : &pixels_;
  }
  [[nodiscard]] std::size_t vertices () const override { return vertices_; }
  [[nodiscard]] std::size_t triangles () const override { return triangles_; }

private:
  SurfacePainter *const painter_;
  SoftwareRenderer renderer_;
  cv::Mat pixels_;
  const FrameSet &set_;
  const bool held_;
  SurfaceSettings settings_;
  SurfaceScene scene_;
  std::size_t vertices_ = 0, triangles_ = 0;
  guint64 uploaded_ = 0;
};

} // namespace

Orbit
orbit_at (double azimuth_deg)
{
  Orbit orbit;
  orbit.azimuth_deg = azimuth_deg;
  return orbit;
}

SurfacePicture
make_picture (const FrameSet &set, double azimuth_deg)
{
  const SceneFrame frame = scene_frame (set.rig);
  std::vector<Vec3> hull;
  for (const RangeImage &image : set.images)
    append_hull (image, *set.rig.find (image.view_id), hull);
  SurfacePicture picture = {};
  picture.background[3] = 0;
  const Orbit orbit = orbit_at (azimuth_deg);
  picture.clip_from_world =
      orbit_matrices (frame, orbit, double (kWidth) / kHeight, true, {}, hull).clip_from_world;
  picture.point_size = 1;
  picture.pixels_per_unit = float (kHeight / (2 * std::tan (frame.fov_deg * M_PI / 360)));
  picture.width = kWidth;
  picture.height = kHeight;
  picture.part = {0, 0, kWidth, kHeight};
  picture.covered = covered_part (picture.clip_from_world, hull, kWidth, kHeight, picture.part);
  return picture;
}

std::unique_ptr<Way>
make_strip_way (std::string name, SurfacePainter *painter, const FrameSet &set,
    const StripSettings &settings, bool held)
{
  return std::make_unique<StripWay> (std::move (name), painter, set, settings, held);
}

} // namespace bench
