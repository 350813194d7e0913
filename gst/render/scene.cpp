/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene.hpp"

#include <algorithm>
#include <rangecast/base/parallel.hpp>
#include <rangecast/surface/scene_hull.hpp>
#include <rangecast/surface/view_matrices.hpp>
#include <rangecast/surface/view_tint.hpp>
#include <string>

using rangecast::RangeImage;
using rangecast::Status;
using rangecast::StatusCode;

void
StripScene::set_rig (const rangecast::Rig &rig)
{
  rig_ = &rig;
  frame_ = rangecast::scene_frame (rig);
  lines_.clear ();
  for (std::size_t i = 0; i < rig.views.size (); i++)
    rangecast::append_camera_lines (rig.views[i], rangecast::camera_colour (i), lines_);
  count_ = 0;
  complete_ = false;
}

Status
StripScene::check (std::span<const RangeImage> images) const
{
  for (const RangeImage &image : images) {
    const std::string name = "range buffer: view " + std::to_string (image.view_id);
    const rangecast::View *view = rig_->find (image.view_id);
    const rangecast::Roi &roi = image.roi;
    if (!view)
      return {StatusCode::kNotFound, name + " is not in the rig of the caps"};
    if (roi.x + roi.width > view->width || roi.y + roi.height > view->height)
      return {StatusCode::kBadSize, name + ": its ROI does not lie in the view's image"};
    if (std::max (roi.width, roi.height) > rangecast::kMaxStripSide)
      return {StatusCode::kBadSize, name + " has an ROI of " + std::to_string (roi.width) + "x" +
                                        std::to_string (roi.height) + " pixels, expected at most " +
                                        std::to_string (rangecast::kMaxStripSide) + " each way"};
  }
  return {};
}

/* The views, by number of their image, that look against the viewer while another one does not. */
guint64
StripScene::views_against (std::span<const RangeImage> images, const StripRenderSettings &settings,
    const rangecast::Orbit &orbit) const
{
  constexpr double kAgainst = -0.2; /* cosine between both directions */
  if (settings.strips.mode != rangecast::StripMode::kBlend)
    return 0;
  const auto matrix = rangecast::orbit_matrices (frame_, orbit, 1, false).clip_from_world;
  guint64 against = 0;
  bool any_along = false;
  for (std::size_t i = 0; i < images.size (); i++) {
    const double along = rangecast::view_alignment (matrix, *rig_->find (images[i].view_id));
    against |= guint64 (along < kAgainst) << i;
    any_along = any_along || along > -kAgainst;
  }
  return any_along ? against : 0;
}

void
StripScene::build_view (std::size_t which, const StripRenderSettings &settings)
{
  ViewMemory &memory = memory_[which];
  const rangecast::ConstRangeImage &image = views_[which].image;
  const bool blends = settings.strips.mode == rangecast::StripMode::kBlend;
  const bool is_reduced = reduced_ >> which & 1;
  const int reach = is_reduced ? 1 : 2; /* beyond the last pixels, quarters of a pixel */
  results_[which] = {};
  if (blends)
    rangecast::make_blend_planes (
        {views_.data (), count_}, which, settings.strips.depth_step, memory.planes);
  rangecast::build_strips (
      image, settings.strips, memory.vertices, results_[which], blends ? &memory.planes : nullptr);
  if (blends)
    rangecast::make_blend_vertices (
        image, memory.planes, memory.vertices, reach, memory.blend_vertices);
  if (is_reduced)
    results_[which].points = memory.reduced.points ();
}

void
StripScene::build (std::span<const RangeImage> images, const StripRenderSettings &settings,
    const rangecast::Orbit &orbit, bool same_frame_set)
{
  const guint64 reduced = views_against (images, settings, orbit);
  const bool built = same_frame_set && reduced == reduced_ && complete_ &&
                     count_ == images.size () && built_with_ == settings.strips_serial;
  const bool blends = settings.strips.mode == rangecast::StripMode::kBlend;
  complete_ = false; /* what follows may throw */
  count_ = images.size ();
  reduced_ = reduced;
  for (std::size_t i = 0; i < images.size (); i++) {
    const bool is_reduced = reduced >> i & 1;
    if (built && is_reduced)
      continue;
    const rangecast::View *view = rig_->find (images[i].view_id);
    rangecast::ConstRangeImage image = images[i]; /* may be mapped elsewhere than last time */
    if (settings.tint_views && built)
      image.colour = views_[i].image.colour;
    else if (settings.tint_views)
      image.colour = rangecast::tinted (images[i].colour,
          rangecast::camera_colour (std::size_t (view - rig_->views.data ())), memory_[i].tinted);
    views_[i] = {image, view};
    if (is_reduced)
      views_[i] = memory_[i].reduced.reduce (views_[i]);
  }
  rangecast::in_parallel (
      built ? 0 : images.size (), 0, [&] (std::size_t i) { build_view (i, settings); });
  for (std::size_t i = 0; i < images.size (); i++) {
    layers_[i] = {views_[i].image, views_[i].view, {}};
    if (blends)
      layers_[i].blend_vertices = memory_[i].blend_vertices;
    else
      layers_[i].vertices = memory_[i].vertices;
  }
  if (!built) {
    hull_.clear ();
    for (const RenderLayer &layer : layers ())
      rangecast::append_hull (layer.image, *layer.view, hull_);
    serial_++;
  }
  built_with_ = settings.strips_serial;
  complete_ = true;
}

void
StripScene::count_into (RenderStats &stats) const
{
  stats.points = stats.strips = stats.isolated = stats.triangles = stats.vertices = 0;
  for (std::size_t i = 0; i < count_; i++) {
    stats.points += results_[i].points;
    stats.strips += results_[i].strips;
    stats.isolated += results_[i].isolated;
    stats.triangles += results_[i].triangles;
    stats.vertices += memory_[i].vertices.size ();
  }
}
