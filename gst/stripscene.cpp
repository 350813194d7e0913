/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stripscene.hpp"

#include <algorithm>
#include <rangecast/parallel.hpp>
#include <rangecast/strips/scene_hull.hpp>
#include <rangecast/strips/view_tint.hpp>
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

bool
StripScene::is_built (std::size_t images, const StripRenderSettings &settings) const
{
  return complete_ && count_ == images && built_with_ == settings.strips_serial;
}

void
StripScene::surround ()
{
  hull_.clear ();
  for (const StripPainter::Layer &layer : layers ())
    rangecast::append_hull (layer.image, *layer.view, hull_);
}

void
StripScene::build (
    std::span<const RangeImage> images, const StripRenderSettings &settings, bool same_frame_set)
{
  const bool built = same_frame_set && is_built (images.size (), settings);
  const bool blends = settings.strips.mode == rangecast::StripMode::kBlend;
  complete_ = false; /* memory may end halfway */
  std::array<rangecast::SurfaceView, rangecast::kMaxViews> views;
  for (std::size_t i = 0; i < images.size (); i++) {
    const rangecast::View *view = rig_->find (images[i].view_id);
    const auto tinted = layers_[i].image.colour;
    rangecast::ConstRangeImage image = images[i];
    if (settings.show_units)
      image.colour = built
                         ? tinted
                         : rangecast::tinted (images[i].colour,
                               rangecast::camera_colour (std::size_t (view - rig_->views.data ())),
                               memory_[i].tinted);
    views[i] = {image, view};
    layers_[i].image.colour = image.colour;
  }
  rangecast::in_parallel (built ? 0 : images.size (), 0, [&] (std::size_t i) {
    results_[i] = {};
    rangecast::BlendPlanes *planes = blends ? &memory_[i].planes : nullptr;
    if (planes)
      rangecast::make_blend_planes (
          {views.data (), images.size ()}, i, settings.strips.depth_step, *planes);
    rangecast::build_strips (
        views[i].image, settings.strips, memory_[i].vertices, results_[i], planes);
  });
  for (std::size_t i = 0; i < images.size (); i++)
    layers_[i] = {
        views[i].image, views[i].view, memory_[i].vertices, blends ? &memory_[i].planes : nullptr};
  count_ = images.size ();
  if (!built) {
    surround ();
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
