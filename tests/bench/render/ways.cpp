/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ways.hpp"

#include <rangecast/parallel.hpp>

using namespace rangecast;

namespace bench {
namespace {

class StripWay : public Way {
public:
  StripWay (std::string name, StripPainter &painter, const FrameSet &set,
      const StripSettings &settings, bool held)
      : Way (std::move (name)), painter_ (painter), set_ (set), settings_ (settings), held_ (held),
        vertices_ (set.images.size ()), results_ (set.images.size ()), planes_ (set.images.size ())
  {
    for (const RangeImage &image : set.images)
      views_.push_back ({image, set.rig.find (image.view_id)});
  }

  void build () override
  {
    if (held_ && uploaded_)
      return;
    in_parallel (vertices_.size (), 0, [&] (std::size_t i) {
      results_[i] = {};
      if (blends ())
        make_blend_planes (views_, i, settings_.depth_step, planes_[i]);
      build_strips (
          set_.images[i], settings_, vertices_[i], results_[i], blends () ? &planes_[i] : nullptr);
    });
  }

  guint64 draw (const StripPainter::Picture &picture) override
  {
    StripPainter::Picture own = picture;
    own.mode = settings_.mode;
    own.depth_step = settings_.depth_step;
    std::vector<StripPainter::Layer> layers;
    for (std::size_t i = 0; i < vertices_.size (); i++)
      layers.push_back (
          {set_.images[i], views_[i].view, vertices_[i], blends () ? &planes_[i] : nullptr});
    const guint64 bytes = held_ && uploaded_ ? 0 : painter_.upload (layers);
    uploaded_ = true;
    painter_.draw (own, layers);
    return bytes;
  }

  [[nodiscard]] std::size_t vertices () const override
  {
    std::size_t n = 0;
    for (const auto &list : vertices_)
      n += list.size ();
    return n;
  }

  [[nodiscard]] std::size_t triangles () const override
  {
    std::size_t n = 0;
    for (const StripResult &result : results_)
      n += result.triangles;
    return n;
  }

private:
  [[nodiscard]] bool blends () const { return settings_.mode == StripMode::kBlend; }

  StripPainter &painter_;
  const FrameSet &set_;
  const StripSettings settings_;
  const bool held_;
  bool uploaded_ = false;
  std::vector<std::vector<StripVertex>> vertices_;
  std::vector<StripResult> results_;
  std::vector<BlendPlanes> planes_;
  std::vector<SurfaceView> views_;
};

} // namespace

std::unique_ptr<Way>
make_strip_way (std::string name, StripPainter &painter, const FrameSet &set,
    const StripSettings &settings, bool held)
{
  return std::make_unique<StripWay> (std::move (name), painter, set, settings, held);
}

} // namespace bench
