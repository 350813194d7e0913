/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stripscene.hpp"

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
  count_ = images_ = 0;
  complete_ = false;
}

Status
StripScene::check (std::span<const RangeImage> images) const
{
  for (const RangeImage &image : images) {
    const rangecast::View *view = rig_->find (image.view_id);
    if (view && (image.roi.x + image.roi.width > view->width ||
                    image.roi.y + image.roi.height > view->height))
      return {StatusCode::kBadSize, "range buffer: the ROI of view " +
                                        std::to_string (image.view_id) +
                                        " does not lie in the view's image"};
  }
  return {};
}

bool
StripScene::is_built (std::size_t images, const StripRenderSettings &settings) const
{
  return complete_ && images_ == images && built_with_ == settings.strips_serial;
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
  complete_ = false; /* memory may end halfway */
  rangecast::in_parallel (built ? 0 : images.size (), 0, [&] (std::size_t i) {
    results_[i] = {};
    rangecast::build_strips (images[i], settings.strips, memory_[i].vertices, results_[i]);
  });
  count_ = 0;
  for (std::size_t i = 0; i < images.size (); i++) {
    const rangecast::View *view = rig_->find (images[i].view_id);
    if (!view)
      continue;
    StripPainter::Layer &layer = layers_[count_++];
    const auto tinted = layer.image.colour;
    layer = {images[i], view, memory_[i].vertices};
    if (settings.show_units)
      layer.image.colour =
          built ? tinted
                : rangecast::tinted (images[i].colour,
                      rangecast::camera_colour (std::size_t (view - rig_->views.data ())),
                      memory_[i].tinted);
  }
  if (!built) {
    surround ();
    serial_++;
  }
  built_with_ = settings.strips_serial;
  images_ = images.size ();
  complete_ = true;
}

void
StripScene::count_into (RenderStats &stats) const
{
  stats.points = stats.strips = stats.isolated = stats.triangles = stats.vertices = 0;
  for (std::size_t i = 0; i < images_; i++) {
    stats.points += results_[i].points;
    stats.strips += results_[i].strips;
    stats.isolated += results_[i].isolated;
    stats.triangles += results_[i].triangles;
    stats.vertices += memory_[i].vertices.size ();
  }
}
