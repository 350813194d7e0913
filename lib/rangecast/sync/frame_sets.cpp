/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frame_sets.hpp"

#include <algorithm>

namespace rangecast {

void
FrameSets::start (int cameras, std::int64_t tolerance, int waiting)
{
  lanes_ = {};
  cameras_ = std::clamp (cameras, 1, kMaxCameras);
  tolerance_ = tolerance;
  waiting_ = std::clamp (waiting, 1, kMaxWaiting);
}

/* next() removes frames beyond waiting_, so the ring has room. */
FrameSets::Frame
FrameSets::put (int camera, std::int64_t key, Frame frame)
{
  Lane &lane = lanes_[camera];
  if (lane.count > waiting_ || (lane.has_last && key <= lane.last_key)) {
    lane.dropped += frame != nullptr;
    return frame;
  }
  lane.last_key = key;
  lane.has_last = true;
  lane.ring[(lane.first + lane.count++) % lane.ring.size ()] = {key, frame};
  return nullptr;
}

void
FrameSets::pop_head (int camera, Set &set)
{
  Lane &lane = lanes_[camera];
  const Waiting &waiting = lane.ring[lane.first];
  set.frames[camera] = waiting.frame;
  set.keys[camera] = waiting.key;
  lane.first = static_cast<int> ((lane.first + 1) % lane.ring.size ());
  lane.count--;
}

FrameSets::Step
FrameSets::next (Set &set)
{
  set = {};
  int longest = 0, oldest = 0;
  bool all = true;
  const auto drop = [&] (int camera) {
    pop_head (camera, set);
    lanes_[camera].dropped += set.frames[camera] != nullptr;
    return Step::kDrop;
  };
  for (int c = 0; c < cameras_; c++) {
    const Lane &lane = lanes_[c];
    all &= lane.count > 0;
    if (lane.count > lanes_[longest].count)
      longest = c;
  }
  if (!all) {
    if (lanes_[longest].count <= waiting_)
      return Step::kWait;
    return drop (longest);
  }
  std::int64_t newest = head (0).key;
  for (int c = 1; c < cameras_; c++) {
    if (head (c).key < head (oldest).key)
      oldest = c;
    newest = std::max (newest, head (c).key);
  }
  if (newest - head (oldest).key > tolerance_) /* the oldest cannot have partners any more */
    return drop (oldest);
  bool lost = false;
  for (int c = 0; c < cameras_; c++) {
    pop_head (c, set);
    lost |= set.frames[c] == nullptr;
  }
  for (int c = 0; lost && c < cameras_; c++)
    lanes_[c].dropped += set.frames[c] != nullptr;
  return lost ? Step::kDrop : Step::kSet;
}

FrameSets::Step
FrameSets::drain (Set &set)
{
  set = {};
  Step step = Step::kWait;
  for (int c = 0; c < cameras_; c++)
    if (lanes_[c].count > 0) {
      pop_head (c, set);
      step = Step::kDrop;
    }
  return step;
}

} // namespace rangecast
