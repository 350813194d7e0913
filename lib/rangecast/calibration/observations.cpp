/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "observations.hpp"

#include <algorithm>

namespace rangecast {
namespace {

constexpr int kMinCommonCorners = 4;

int
common_corners (const Sighting &a, const Sighting &b)
{
  int count = 0;
  for (auto i = a.corners.begin (), j = b.corners.begin ();
       i != a.corners.end () && j != b.corners.end ();) {
    count += i->id == j->id;
    const bool forward_i = i->id <= j->id, forward_j = j->id <= i->id;
    i += forward_i;
    j += forward_j;
  }
  return count;
}

} // namespace

std::string_view
role_name (CameraRole role)
{
  static constexpr std::string_view kNames[] = {"left", "right", "third"};
  return kNames[int (role)];
}

std::string
text_of (const CalibrationCamera &camera)
{
  return camera.name + " (view " + std::to_string (camera.view_id) + ", " +
         std::string (role_name (camera.role)) + ")";
}

const Sighting *
CalibrationFrame::find (int camera) const
{
  const auto found = std::ranges::find (sightings, camera, &Sighting::camera);
  return found == sightings.end () ? nullptr : &*found;
}

int
shared_frames (const std::vector<CalibrationFrame> &frames, int a, int b)
{
  return int (std::ranges::count_if (frames, [&] (const CalibrationFrame &frame) {
    const Sighting *first = frame.find (a), *second = frame.find (b);
    return first && second && common_corners (*first, *second) >= kMinCommonCorners;
  }));
}

std::vector<int>
linked_groups (int cameras, const std::vector<CalibrationFrame> &frames, int fewest_shared)
{
  std::vector<int> groups (cameras, -1);
  int next = 0;
  for (int first = 0; first < cameras; first++) {
    if (groups[first] >= 0)
      continue;
    std::vector<int> open = {first};
    groups[first] = next;
    while (!open.empty ()) {
      const int a = open.back ();
      open.pop_back ();
      for (int b = 0; b < cameras; b++)
        if (groups[b] < 0 && shared_frames (frames, a, b) >= fewest_shared) {
          groups[b] = next;
          open.push_back (b);
        }
    }
    next++;
  }
  return groups;
}

} // namespace rangecast
