/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene.hpp"

#include <algorithm>
#include <string>

using rangecast::RangeImage;
using rangecast::Status;
using rangecast::StatusCode;

void
StripScene::set_rig (const rangecast::Rig &rig)
{
  rig_ = &rig;
  SurfaceScene::set_rig (rig);
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

void
StripScene::count_into (RenderStats &stats) const
{
  stats.points = stats.strips = stats.isolated = stats.triangles = stats.vertices = 0;
  for (std::size_t i = 0; i < layers ().size (); i++) {
    stats.points += result (i).points;
    stats.strips += result (i).strips;
    stats.isolated += result (i).isolated;
    stats.triangles += result (i).triangles;
    stats.vertices += vertices (i);
  }
}
