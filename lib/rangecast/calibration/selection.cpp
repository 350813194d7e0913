/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "selection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr double kNewPlace = 0.1;      // see BoardPlace
constexpr double kTiltSeen = 0.2;      // sine of an angle
constexpr double kSizeRatio = 1.25;    // of the largest to the smallest board
constexpr double kMotionShare = 0.003; // of the image's width, between two frames
constexpr std::uint64_t kMotionNs = 1'000'000'000;
constexpr double kBlurredPx = 6, kBlurredShare = 0.004; // the larger of both, of the width
constexpr int kFewLinks = 8; // two cameras with fewer common frames want more

/* The board's normal for a camera whose focal length is the image width. */
bool
guess_normal (const std::vector<cv::Point3d> &object, const std::vector<cv::Point2d> &image,
    int width, int height, cv::Vec3d &normal)
{
  const double f = std::max (width, height);
  const cv::Matx33d k (f, 0, (width - 1) / 2.0, 0, f, (height - 1) / 2.0, 0, 0, 1);
  cv::Vec3d rvec, tvec;
  cv::Matx33d r;
  try {
    if (!cv::solvePnP (object, image, k, cv::noArray (), rvec, tvec))
      return false;
    cv::Rodrigues (rvec, r);
  } catch (const std::exception &) {
    return false;
  }
  normal = {r (0, 2), r (1, 2), r (2, 2)};
  if (normal[2] < 0)
    normal = -normal; /* away from the camera, for either direction of the board's z axis */
  return std::isfinite (normal[0]) && std::isfinite (normal[1]);
}

double
distance (const BoardPlace &a, const BoardPlace &b)
{
  /* Tilts count half: 12 degrees are equivalent to a tenth of the image. */
  return std::sqrt ((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) +
                    (a.size - b.size) * (a.size - b.size) +
                    0.25 * (a.tilt_x - b.tilt_x) * (a.tilt_x - b.tilt_x) +
                    0.25 * (a.tilt_y - b.tilt_y) * (a.tilt_y - b.tilt_y));
}

} // namespace

BoardPlace
place_board (const BoardSpec &board, const std::vector<BoardCorner> &corners, int width, int height)
{
  BoardPlace place;
  if (corners.size () < 4 || width <= 0 || height <= 0)
    return place;
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  std::vector<cv::Point2f> points;
  for (const BoardCorner &c : corners) {
    const Vec3 p = board.corner (c.id);
    object.emplace_back (p.x, p.y, p.z);
    image.emplace_back (c.x, c.y);
    points.emplace_back (float (c.x), float (c.y));
    place.x += c.x / width / double (corners.size ());
    place.y += c.y / height / double (corners.size ());
  }
  std::vector<cv::Point2f> hull;
  cv::convexHull (points, hull);
  place.size = std::sqrt (cv::contourArea (hull) / (double (width) * height));
  /* The normal points away from the camera; if the right end is farther, it points to the left. */
  if (cv::Vec3d normal; guess_normal (object, image, width, height, normal)) {
    place.tilt_x = -normal[0];
    place.tilt_y = -normal[1];
  }
  return place;
}

/* ---- coverage ---- */

double
CameraCoverage::share () const
{
  const auto seen = std::ranges::count (cells, true) + tilted_left + tilted_right + tilted_up +
                    tilted_down + distances;
  return double (seen) / (cells.size () + 5);
}

std::vector<std::string>
CameraCoverage::missing () const
{
  static constexpr const char *kAcross[kColumns] = {"left", "middle left", "middle right", "right"};
  static constexpr const char *kDown[kRows] = {"top", "middle", "bottom"};
  std::vector<std::string> list;
  for (int row = 0; row < kRows; row++)
    for (int column = 0; column < kColumns; column++)
      if (!cells[row * kColumns + column])
        list.push_back (
            std::string ("board at the ") + kDown[row] + " " + kAcross[column] + " of the image");
  if (!tilted_left)
    list.emplace_back ("left end of the board turned away");
  if (!tilted_right)
    list.emplace_back ("right end of the board turned away");
  if (!tilted_up)
    list.emplace_back ("upper end of the board turned away");
  if (!tilted_down)
    list.emplace_back ("lower end of the board turned away");
  if (!distances)
    list.emplace_back ("board nearer or farther");
  return list;
}

CameraCoverage
FrameSelector::coverage (const CalibrationCamera &camera, int index) const
{
  CameraCoverage c;
  double smallest = std::numeric_limits<double>::max (), largest = 0;
  for (std::size_t f = 0; f < frames_.size (); f++) {
    const Sighting *sighting = frames_[f].find (index);
    if (!sighting)
      continue;
    c.frames++;
    for (const BoardCorner &corner : sighting->corners) {
      const int column = std::clamp (int (corner.x * c.kColumns / camera.width), 0, c.kColumns - 1);
      const int row = std::clamp (int (corner.y * c.kRows / camera.height), 0, c.kRows - 1);
      c.cells[row * c.kColumns + column] = true;
    }
    for (const auto &[other, place] : places_[f])
      if (other == index) {
        c.tilted_left |= place.tilt_x < -kTiltSeen;
        c.tilted_right |= place.tilt_x > kTiltSeen;
        c.tilted_up |= place.tilt_y < -kTiltSeen;
        c.tilted_down |= place.tilt_y > kTiltSeen;
        smallest = std::min (smallest, place.size);
        largest = std::max (largest, place.size);
      }
  }
  c.distances = largest > kSizeRatio * smallest;
  return c;
}

/* ---- selection ---- */

std::string_view
verdict_name (FrameVerdict verdict)
{
  static constexpr std::string_view kNames[kFrameVerdicts] = {
      "taken", "no-board", "moving", "blurred", "similar"};
  return kNames[int (verdict)];
}

void
FrameSelector::set (const BoardSpec &board, const SelectionSettings &settings)
{
  board_ = board;
  settings_ = settings;
  clear ();
}

void
FrameSelector::clear ()
{
  frames_.clear ();
  places_.clear ();
  last_.clear ();
}

/* Compares each image with the same camera's previous one, which may belong to an earlier frame
 * than those of other cameras. A board that was not in it counts as moving. */
bool
FrameSelector::is_moving (const std::vector<CalibrationCamera> &cameras,
    const CalibrationFrame &frame, std::uint64_t time_ns) const
{
  for (const Sighting &sighting : frame.sightings) {
    const LastImage &before = last_[sighting.camera];
    if (!before.valid || time_ns - before.time_ns >= kMotionNs)
      continue;
    double moved = 0;
    int common = 0;
    for (const BoardCorner &corner : sighting.corners) {
      const auto old = std::ranges::find (before.corners, corner.id, &BoardCorner::id);
      if (old == before.corners.end ())
        continue;
      moved += std::hypot (corner.x - old->x, corner.y - old->y);
      common++;
    }
    if (common == 0 || moved / common > kMotionShare * cameras[sighting.camera].width)
      return true;
  }
  return false;
}

void
FrameSelector::record_images (
    const CalibrationFrame &frame, std::uint64_t time_ns, const std::vector<bool> &has_image)
{
  for (std::size_t i = 0; i < last_.size (); i++)
    if (has_image.empty () || has_image[i]) {
      const Sighting *sighting = frame.find (int (i));
      last_[i] = {true, time_ns, sighting ? sighting->corners : std::vector<BoardCorner>{}};
    }
}

/* The maximum over all cameras of the difference from all frames but `except`. */
double
FrameSelector::difference (const Places &places, std::size_t except) const
{
  double max = 0;
  for (const auto &[camera, place] : places) {
    double nearest = std::numeric_limits<double>::max ();
    for (std::size_t f = 0; f < places_.size (); f++)
      if (f != except)
        for (const auto &[other, old] : places_[f])
          if (other == camera)
            nearest = std::min (nearest, distance (place, old));
    max = std::max (max, nearest);
  }
  return max;
}

/* Two cameras with few common frames want more of them: places may differ by half as much, and only
 * frames that both cameras share count as similar. */
bool
FrameSelector::is_new (const Places &places) const
{
  double wanted = kNewPlace;
  for (const auto &[a, place_a] : places)
    for (const auto &[b, place_b] : places) {
      if (a >= b || shared_frames (frames_, a, b) >= kFewLinks)
        continue;
      wanted = kNewPlace / 2;
      double nearest = std::numeric_limits<double>::max ();
      for (const Places &old : places_) {
        const auto old_a = std::ranges::find (old, a, &Places::value_type::first);
        const auto old_b = std::ranges::find (old, b, &Places::value_type::first);
        if (old_a != old.end () && old_b != old.end ())
          nearest = std::min (nearest,
              std::max (distance (place_a, old_a->second), distance (place_b, old_b->second)));
      }
      if (nearest >= wanted)
        return true;
    }
  return difference (places, std::numeric_limits<std::size_t>::max ()) >= wanted;
}

/* At the maximum number, the most redundant frame is replaced, unless the new one is more
 * redundant. The first frame is kept: its board may define the world. */
FrameVerdict
FrameSelector::take (CalibrationFrame frame, Places places)
{
  if (int (frames_.size ()) < settings_.max_frames) {
    frames_.push_back (std::move (frame));
    places_.push_back (std::move (places));
    return FrameVerdict::kTaken;
  }
  std::size_t most_redundant = 0;
  double smallest = std::numeric_limits<double>::max ();
  for (std::size_t f = 1; f < places_.size (); f++)
    if (const double d = difference (places_[f], f); d < smallest) {
      smallest = d;
      most_redundant = f;
    }
  if (difference (places, most_redundant) <= smallest)
    return FrameVerdict::kSimilar;
  frames_[most_redundant] = std::move (frame);
  places_[most_redundant] = std::move (places);
  return FrameVerdict::kTaken;
}

FrameVerdict
FrameSelector::offer (const std::vector<CalibrationCamera> &cameras, CalibrationFrame frame,
    const std::vector<double> &edge_widths, std::uint64_t time_ns,
    const std::vector<bool> &has_image)
{
  last_.resize (cameras.size ());
  const bool moving = is_moving (cameras, frame, time_ns);
  record_images (frame, time_ns, has_image);
  if (frame.sightings.empty ())
    return FrameVerdict::kNoBoard;

  Places places;
  for (const Sighting &s : frame.sightings)
    places.emplace_back (s.camera,
        place_board (board_, s.corners, cameras[s.camera].width, cameras[s.camera].height));
  if (settings_.all)
    return take (std::move (frame), std::move (places));
  if (moving)
    return FrameVerdict::kMoving;
  for (std::size_t i = 0; i < edge_widths.size () && i < frame.sightings.size (); i++)
    if (edge_widths[i] >
        std::max (kBlurredPx, kBlurredShare * cameras[frame.sightings[i].camera].width))
      return FrameVerdict::kBlurred;
  if (!frames_.empty () && !is_new (places))
    return FrameVerdict::kSimilar;
  return take (std::move (frame), std::move (places));
}

} // namespace rangecast
