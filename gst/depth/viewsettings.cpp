/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "viewsettings.hpp"

#include <rangecast/rigfile/rig_file.hpp>

using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

Status
load_view (const std::string &rig_file, int view_id, const char *property, int width, int height,
    View &view)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (rig_file, rig); !s.ok ())
    return s;
  const View *found = rig.find (view_id);
  if (!found)
    return {StatusCode::kNotFound, rig_file + ": has no view with view-id " +
                                       std::to_string (view_id) + ", the value of property " +
                                       property};
  view = *found;
  const Status scaled = rangecast::scale_view (view, width, height);
  return scaled.ok () ? scaled : Status{scaled.code (), rig_file + ": " + scaled.message ()};
}

View
make_pinhole_view (const ViewSettings &settings, double focal_length, int width, int height)
{
  View view;
  view.id = settings.view_id;
  view.width = width;
  view.height = height;
  view.intrinsics = {focal_length, focal_length,
      settings.principal_x >= 0 ? settings.principal_x : (width - 1) / 2.0,
      settings.principal_y >= 0 ? settings.principal_y : (height - 1) / 2.0};
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  return view;
}

void
set_depth_range (const ViewSettings &settings, View &view)
{
  if (settings.depth_unit > 0)
    view.depth_unit_m = settings.depth_unit;
  if (settings.near > 0)
    view.near_m = settings.near;
  if (settings.far > 0)
    view.far_m = settings.far;
}
