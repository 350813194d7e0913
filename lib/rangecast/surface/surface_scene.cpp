/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surface_scene.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "../base/parallel.hpp"
#include "orbit.hpp"
#include "scene_hull.hpp"
#include "view_tint.hpp"

namespace rangecast {

bool
SurfaceScene::set_rig (const Rig &rig)
{
  constexpr double kMoved = 0.1; /* metres; rangealign corrects poses by less */
  Rig all = rig;
  bool same = true;
  for (const View &before : known_.views)
    if (const View *now = rig.find (before.id); !now)
      all.views.push_back (before);
    else
      same = same && now->width == before.width && now->height == before.height &&
             norm (now->world_from_view.translation - before.world_from_view.translation) < kMoved;
  rig_ = &rig;
  known_ = same ? std::move (all) : rig;
  frame_ = scene_frame (known_);
  count_ = 0;
  complete_ = false;
  return same;
}

/* Half a pixel where a view looks as the viewer does, within 30 degrees. From the side it would
 * cover what lies next to it: a quarter. kReduced: the view looks against the viewer or past them
 * (84 degrees) while another one looks within 60 degrees. */
SurfaceScene::Reaches
SurfaceScene::reaches_for (
    std::span<const RangeImage> images, const SurfaceSettings &settings, const Orbit &orbit) const
{
  Reaches reaches;
  reaches.fill (4);
  if (settings.strips.mode != StripMode::kBlend)
    return reaches;
  const auto matrix = orbit_matrices (frame_, orbit, 1, false).clip_from_world;
  bool any_along = false;
  for (std::size_t i = 0; i < images.size (); i++) {
    const double along = view_alignment (matrix, *rig_->find (images[i].view_id)); /* cosine */
    reaches[i] = along > 0.866 ? 2 : along < 0.1 ? kReduced : 1;
    any_along = any_along || along > 0.5;
  }
  if (!any_along)
    std::fill_n (reaches.begin (), images.size (), 2);
  return reaches;
}

void
SurfaceScene::build_view (std::size_t which, const SurfaceSettings &settings)
{
  ViewMemory &memory = memory_[which];
  const ConstRangeImage &image = views_[which].image;
  const bool blends = settings.strips.mode == StripMode::kBlend;
  results_[which] = {};
  if (blends)
    make_blend_planes ({views_.data (), count_}, which, settings.strips.depth_step, memory.planes);
  const BlendPlanes *planes = blends ? &memory.planes : nullptr;
  build_strips (image, settings.strips, memory.strips, results_[which], planes);
  make_vertices (image, planes, memory.strips, std::abs (reaches_[which]), memory.vertices);
  if (reaches_[which] == kReduced)
    results_[which].points = memory.reduced.points ();
}

void
SurfaceScene::build (std::span<const RangeImage> images, const SurfaceSettings &settings,
    const Orbit &orbit, bool same_frame_set)
{
  const Reaches reaches = reaches_for (images, settings, orbit);
  const bool built = same_frame_set && reaches == reaches_ && complete_ &&
                     built_with_ == settings &&
                     std::ranges::equal (images, layers (), {}, &RangeImage::view_id,
                         [] (const SurfaceLayer &layer) { return layer.image.view_id; });
  complete_ = false; /* what follows may throw */
  count_ = images.size ();
  reaches_ = reaches;
  for (std::size_t i = 0; i < images.size (); i++) {
    const bool is_reduced = reaches[i] == kReduced;
    if (built && is_reduced)
      continue;
    const View *view = rig_->find (images[i].view_id);
    ConstRangeImage image = images[i]; /* may be mapped elsewhere than last time */
    if (settings.tint_views && built)
      image.colour = views_[i].image.colour;
    else if (settings.tint_views)
      image.colour = tinted (images[i].colour,
          view_colour (std::size_t (view - rig_->views.data ())), memory_[i].tinted);
    views_[i] = {image, view};
    if (is_reduced)
      views_[i] = memory_[i].reduced.reduce (views_[i]);
  }
  in_parallel (built ? 0 : images.size (), 0, [&] (std::size_t i) { build_view (i, settings); });
  for (std::size_t i = 0; i < images.size (); i++)
    layers_[i] = {views_[i].image, views_[i].view, memory_[i].vertices};
  if (!built) {
    hull_.clear ();
    for (const SurfaceLayer &layer : layers ())
      append_hull (layer.image, *layer.view, hull_);
    serial_++;
  }
  built_with_ = settings;
  complete_ = true;
}

} // namespace rangecast
