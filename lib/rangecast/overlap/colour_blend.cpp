/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "colour_blend.hpp"

#include <algorithm>
#include <cmath>

#include "../base/guarded.hpp"
#include "../base/parallel.hpp"

namespace rangecast {

namespace {

constexpr std::uint8_t kFar = 255;
constexpr int kMaxSteps = 250;              /* half pixels that a seam reaches */
constexpr int kStraight = 2, kDiagonal = 3; /* half pixels to a neighbour */

constexpr int kCell = 8;          /* pixels */
constexpr float kPrior = 2 * 128; /* as 2 grey pixels that agree */
constexpr float kMaxRatio = 1.5f;

constexpr int kNeighbours[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

int
cells_across (const RangeImage &image)
{
  return (image.depth.width + kCell - 1) / kCell;
}
int
cells_down (const RangeImage &image)
{
  return (image.depth.height + kCell - 1) / kCell;
}

} // namespace

Status
ColourBlend::remember (std::span<const RangeImage> images)
{
  begin_.clear ();
  const Status status = guarded ("blend", [&] () -> Status {
    if (Status bad = cameras_.check (images); !bad.ok ())
      return bad;
    std::size_t pixels = 0;
    for (const RangeImage &image : images) {
      begin_.push_back (pixels);
      if (!image.depth.empty ())
        pixels += static_cast<std::size_t> (image.depth.width) * image.depth.height;
    }
    begin_.push_back (pixels);
    if (seams_.size () < pixels) { /* the last to grow: all have grown */
      before_.resize (pixels);
      lost_.resize (pixels);
      seams_.resize (pixels);
    }
    return {};
  });
  if (!status.ok ()) {
    begin_.clear ();
    return status;
  }
  for (std::size_t i = 0; i < images.size (); i++)
    for (int y = 0; y < images[i].depth.height && !images[i].depth.empty (); y++)
      std::copy_n (images[i].depth.row (y), images[i].depth.width,
          before_.data () + begin_[i] + static_cast<std::size_t> (y) * images[i].depth.width);
  return {};
}

/* The image that still has the point which image i had at (x, y); -1 if none. */
int
ColourBlend::owner_of (Images images, std::size_t i, int x, int y) const
{
  float point[3];
  cameras_.point (images[i], x, y, before (images, i, x, y), point);
  int owner = -1;
  float nearest = 1; /* share of the maximum difference on one surface */
  for (std::size_t j = 0; j < images.size (); j++) {
    const RangeImage &other = images[j];
    ColourCameras::Place place;
    if (j == i || !has_colour (other) || !cameras_.find (other, point, place))
      continue;
    const std::uint16_t there =
        other.depth.at (ColourCameras::column (place), ColourCameras::row (place));
    if (there == kInvalidDepth)
      continue;
    const float off = std::abs (place.depth - there) /
                      cameras_.of[static_cast<std::size_t> (other.view_id)].max_difference;
    if (off < nearest) {
      nearest = off;
      owner = static_cast<int> (j);
    }
  }
  return owner;
}

/* The image whose points begin beside a point that image i kept; -1: none. */
int
ColourBlend::seam_at (Images images, std::size_t i, int x, int y) const
{
  const RangeImage &image = images[i];
  const int depth = image.depth.at (x, y);
  const float same = cameras_.of[static_cast<std::size_t> (image.view_id)].max_difference;
  for (const auto &step : kNeighbours) {
    const int u = x + step[0], v = y + step[1];
    if (u < 0 || v < 0 || u >= image.depth.width || v >= image.depth.height ||
        image.depth.at (u, v) != kInvalidDepth)
      continue;
    const int was = before (images, i, u, v);
    if (was == kInvalidDepth || static_cast<float> (std::abs (was - depth)) > same)
      continue;
    if (const int owner = owner_of (images, i, u, v); owner >= 0)
      return owner;
  }
  return -1;
}

void
ColourBlend::find_lost (Images images, std::size_t i)
{
  const RangeImage &image = images[i];
  for (int y = 0; y < image.depth.height; y++) {
    const std::size_t row = begin_[i] + static_cast<std::size_t> (y) * image.depth.width;
    const std::uint16_t *__restrict now = image.depth.row (y);
    const std::uint16_t *__restrict was = before_.data () + row;
    std::uint8_t *__restrict lost = lost_.data () + row;
    for (int x = 0; x < image.depth.width; x++)
      lost[x] = (now[x] == kInvalidDepth) & (was[x] != kInvalidDepth);
  }
}

void
ColourBlend::find_seams (Images images, std::size_t i)
{
  const RangeImage &image = images[i];
  const int width = image.depth.width, height = image.depth.height;
  works_[i].first = height;
  works_[i].last = -1;
  works_[i].nearest = 65535;
  for (int y = 0; y < height; y++) {
    const std::size_t row = begin_[i] + static_cast<std::size_t> (y) * width;
    const std::uint8_t *lost = lost_.data () + row;
    const std::uint8_t *above = y > 0 ? lost - width : lost,
                       *below = y + 1 < height ? lost + width : lost;
    const std::uint16_t *depth = image.depth.row (y);
    Seam *seams = seams_.data () + row;
    for (int x = 0; x < width; x++) {
      seams[x] = {kFar, 0};
      if (depth[x] == kInvalidDepth ||
          !(above[x] | below[x] | lost[std::max (x - 1, 0)] | lost[std::min (x + 1, width - 1)]))
        continue;
      const int owner = seam_at (images, i, x, y);
      if (owner < 0)
        continue;
      seams[x] = {kStraight / 2, static_cast<std::uint8_t> (owner)};
      works_[i].first = std::min (works_[i].first, y);
      works_[i].last = y;
      works_[i].nearest = std::min<int> (works_[i].nearest, depth[x]);
    }
  }
}

/* Half pixels that no seam reaches beyond; surfaces come a fifth nearer at most on the way. */
int
ColourBlend::farthest (const RangeImage &image, const Work &work, float width_m) const
{
  const float pixels = width_m *
                       cameras_.of[static_cast<std::size_t> (image.view_id)].pixels_per_metre /
                       (0.8f * static_cast<float> (work.nearest));
  return static_cast<int> (std::min (2 * pixels + 1, static_cast<float> (kMaxSteps)));
}

/* One of the two passes of a chamfer distance transform over the points that are kept. */
void
ColourBlend::spread (Images images, std::size_t i, int max_distance, bool down)
{
  const RangeImage &image = images[i];
  const Work &work = works_[i];
  const int width = image.depth.width, way = down ? -1 : 1;
  const int first = std::max (0, work.first - max_distance / 2),
            last = std::min (image.depth.height - 1, work.last + max_distance / 2);
  const float same = cameras_.of[static_cast<std::size_t> (image.view_id)].max_difference;
  for (int k = 0; k <= last - first; k++) {
    const int y = down ? first + k : last - k;
    Seam *here = seams_.data () + begin_[i] + static_cast<std::size_t> (y) * width;
    const Seam *there = k > 0 ? here + way * width : here; /* nothing nearer in its own row */
    const std::uint16_t *depth = image.depth.row (y),
                        *other = k > 0 ? image.depth.row (y + way) : depth;
    const auto offer = [&] (Seam &seam, const Seam &near, int step, int apart) {
      const int distance = near.distance + step;
      if (distance < seam.distance && distance <= max_distance &&
          static_cast<float> (std::abs (apart)) <= same)
        seam = {static_cast<std::uint8_t> (distance), near.other};
    };
    for (int column = 0; column < width; column++) {
      const int x = down ? column : width - 1 - column, d = depth[x];
      if (d == kInvalidDepth)
        continue;
      const int left = std::max (x - 1, 0), right = std::min (x + 1, width - 1),
                before = down ? left : right;
      Seam &seam = here[x];
      /* Far from all seams, as most pixels are. */
      if ((there[left].distance & there[x].distance & there[right].distance &
              here[before].distance) == kFar)
        continue;
      offer (seam, here[before], kStraight, depth[before] - d);
      offer (seam, there[left], kDiagonal, other[left] - d);
      offer (seam, there[x], kStraight, other[x] - d);
      offer (seam, there[right], kDiagonal, other[right] - d);
    }
  }
}

/* The pixels within the width, and their shares. */
void
ColourBlend::find_near (Images images, std::size_t i, int max_distance, float width_m)
{
  const RangeImage &image = images[i];
  Work &work = works_[i];
  const float pixels =
      width_m * cameras_.of[static_cast<std::size_t> (image.view_id)].pixels_per_metre;
  work.near.clear ();
  work.near.reserve (begin_[i + 1] - begin_[i]); /* as many as there can be, once */
  const int last = std::min (image.depth.height - 1, work.last + max_distance / 2);
  for (int y = std::max (0, work.first - max_distance / 2); y <= last; y++) {
    const Seam *seams =
        seams_.data () + begin_[i] + static_cast<std::size_t> (y) * image.depth.width;
    for (int x = 0; x < image.depth.width; x++) {
      if (seams[x].distance == kFar)
        continue;
      const float width =
          std::min (pixels / static_cast<float> (image.depth.at (x, y)), kMaxSteps / 2.0f);
      const float t = seams[x].distance * 0.5f / width;
      if (t < 1)
        work.near.push_back ({static_cast<std::uint16_t> (x), static_cast<std::uint16_t> (y),
            0.5f * (1 - t * t * (3 - 2 * t))});
    }
  }
}

/* What image j saw of a point, before anything was cleared, between its pixels. */
bool
ColourBlend::seen_by (
    Images images, std::size_t j, const float point[3], Colour &colour, float &trust) const
{
  const RangeImage &image = images[j];
  ColourCameras::Place place;
  if (!cameras_.find (image, point, place))
    return false;
  const float same = cameras_.of[static_cast<std::size_t> (image.view_id)].max_difference;
  const int left = std::min (static_cast<int> (place.x), image.depth.width - 2),
            top = std::min (static_cast<int> (place.y), image.depth.height - 2);
  float weights = 0, off = 0;
  colour = {};
  for (int v = std::max (top, 0); v <= top + 1; v++)
    for (int u = std::max (left, 0); u <= left + 1; u++) {
      const int there = before (images, j, u, v);
      const float error = std::abs (place.depth - static_cast<float> (there));
      if (there == kInvalidDepth || !(error < same))
        continue;
      const float weight = (1 - std::abs (place.x - static_cast<float> (u))) *
                           (1 - std::abs (place.y - static_cast<float> (v)));
      const Rgbx pixel = image.colour.at (u, v);
      colour[0] += weight * pixel.r;
      colour[1] += weight * pixel.g;
      colour[2] += weight * pixel.b;
      off += weight * error / same;
      weights += weight;
    }
  if (weights < 0.25f)
    return false;
  for (float &c : colour)
    c /= weights;
  trust = weights * (1 - (off / weights) * (off / weights));
  return true;
}

void
ColourBlend::Cell::add (const Cell &other, float weight)
{
  for (std::size_t c = 0; c < 3; c++) {
    mine[c] += weight * other.mine[c];
    theirs[c] += weight * other.theirs[c];
  }
}

/* Fills the cells, from a quarter of the pixels near the seam, in a pattern that no texture of one
 * or two pixels has. */
void
ColourBlend::compare (Images images, std::size_t i)
{
  const RangeImage &image = images[i];
  const int columns = cells_across (image);
  Work &work = works_[i];
  work.cells.assign (static_cast<std::size_t> (columns) * cells_down (image), {});
  for (const Near &near : work.near) {
    if ((near.x & 1) || (near.y & 1) != (near.x >> 1 & 1))
      continue;
    const Seam seam =
        seams_[begin_[i] + static_cast<std::size_t> (near.y) * image.depth.width + near.x];
    float point[3], trust;
    Cell pixel;
    cameras_.point (image, near.x, near.y, image.depth.at (near.x, near.y), point);
    if (!seen_by (images, seam.other, point, pixel.theirs, trust))
      continue;
    const Rgbx mine = image.colour.at (near.x, near.y);
    pixel.mine = {
        static_cast<float> (mine.r), static_cast<float> (mine.g), static_cast<float> (mine.b)};
    work.cells[static_cast<std::size_t> (near.y / kCell) * columns + near.x / kCell].add (
        pixel, trust);
  }
}

/* A ratio for each cell, from it and, for less, those round it. */
void
ColourBlend::find_ratios (const RangeImage &image, Work &work) const
{
  const int columns = cells_across (image), rows = cells_down (image);
  work.ratios.resize (work.cells.size ());
  /* Of cells that pixels lie in or next to. */
  const int top = std::max (work.near.front ().y / kCell - 1, 0),
            bottom = std::min (work.near.back ().y / kCell + 1, rows - 1);
  for (int y = top; y <= bottom; y++)
    for (int x = 0; x < columns; x++) {
      Cell sum;
      for (int v = std::max (y - 1, 0); v <= std::min (y + 1, rows - 1); v++)
        for (int u = std::max (x - 1, 0); u <= std::min (x + 1, columns - 1); u++)
          sum.add (work.cells[static_cast<std::size_t> (v) * columns + u],
              (u == x ? 1.0f : 0.5f) * (v == y ? 1.0f : 0.5f));
      Colour &ratio = work.ratios[static_cast<std::size_t> (y) * columns + x];
      for (std::size_t c = 0; c < 3; c++)
        ratio[c] = std::clamp (
            (sum.theirs[c] + kPrior) / (sum.mine[c] + kPrior), 1 / kMaxRatio, kMaxRatio);
    }
}

/* The ratio between the middles of cells is linear. */
void
ColourBlend::change (const RangeImage &image, const Work &work) const
{
  const int columns = cells_across (image), rows = cells_down (image);
  for (const Near &near : work.near) {
    const float u = (static_cast<float> (near.x) + 0.5f) / kCell - 0.5f,
                v = (static_cast<float> (near.y) + 0.5f) / kCell - 0.5f;
    const int left = std::clamp (static_cast<int> (u), 0, std::max (columns - 2, 0)),
              top = std::clamp (static_cast<int> (v), 0, std::max (rows - 2, 0));
    const float right = std::clamp (u - static_cast<float> (left), 0.0f, 1.0f),
                below = std::clamp (v - static_cast<float> (top), 0.0f, 1.0f);
    const Colour *a = &work.ratios[static_cast<std::size_t> (top) * columns + left];
    const Colour *b = a + (columns > 1), *c = a + (rows > 1 ? columns : 0), *d = c + (columns > 1);
    Rgbx &colour = image.colour.at (near.x, near.y);
    std::uint8_t *values[] = {&colour.r, &colour.g, &colour.b};
    for (std::size_t k = 0; k < 3; k++) {
      const float upper = (*a)[k] + right * ((*b)[k] - (*a)[k]),
                  lower = (*c)[k] + right * ((*d)[k] - (*c)[k]),
                  ratio = upper + below * (lower - upper);
      const float value = *values[k] * (1 + near.share * (ratio - 1)) + 0.5f;
      *values[k] = static_cast<std::uint8_t> (std::min (value, 255.0f));
    }
  }
}

/* Allocates; see blend(). */
Status
ColourBlend::work (Images images, double width_m, int threads)
{
  bool same = begin_.size () == images.size () + 1;
  for (std::size_t i = 0; same && i < images.size (); i++) {
    const ImageView<std::uint16_t> &depth = images[i].depth;
    same = begin_[i + 1] - begin_[i] ==
           (depth.empty () ? 0 : static_cast<std::size_t> (depth.width) * depth.height);
  }
  if (!same)
    return {StatusCode::kBadSize, "blend: expected the images of the last analysis"};
  if (!(width_m > 0))
    return {};
  const auto width = static_cast<float> (std::min (width_m, 1.0));
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    works_[i].near.clear ();
    if (!has_colour (images[i]))
      return;
    find_lost (images, i);
    find_seams (images, i);
    if (works_[i].last < 0)
      return;
    const int max_distance = farthest (images[i], works_[i], width);
    spread (images, i, max_distance, true);
    spread (images, i, max_distance, false);
    find_near (images, i, max_distance, width);
    if (works_[i].near.empty ())
      return;
    compare (images, i);
    find_ratios (images[i], works_[i]);
  });
  /* When no image is read for another one any more. */
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    if (!works_[i].near.empty ())
      change (images[i], works_[i]);
  });
  return {};
}

Status
ColourBlend::blend (std::span<const RangeImage> images, double width_m, int threads)
{
  return guarded ("blend", [&] { return work (images, width_m, threads); });
}

} // namespace rangecast
