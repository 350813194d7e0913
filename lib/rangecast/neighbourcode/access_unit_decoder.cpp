/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "access_unit.hpp"

#include <algorithm>

#include "bitstream/slice_place.hpp"

namespace rangecast {
namespace {

/* A view is decoded in at most so many jobs: each has enough slices that a hostile stream cannot
 * make too many jobs, and threads end at about the same time. */
constexpr std::uint64_t kJobsOfView = 32;

} // namespace

Status
AccessUnitDecoder::set_rig (const Rig &rig)
{
  if (Status s = decoder_.set_rig (rig); !s.ok ())
    return s;
  references_ = {}; /* frees memory, too: the views may differ */
  count_ = 0;
  return {};
}

void
AccessUnitDecoder::reset_references ()
{
  for (ReferencePair &pair : references_)
    pair.reset ();
}

/* Prepares a view before any of its slices is decoded. */
void
AccessUnitDecoder::begin_view (
    std::size_t index, const RangeImage &image, const ConstRangeImage &older)
{
  const PlannedView &planned = planned_[index];
  decoder_.prepare (planned.reference);
  if (planned.reference.reference)
    references_[planned.view_id].begin (planned.reference);
  if (planned.held_pixels != area_of (planned.roi)) /* not every pixel is coded */
    fill_from (older, image);
}

void
AccessUnitDecoder::add_jobs (std::size_t view)
{
  const PlannedView &planned = planned_[view];
  const std::uint64_t enough = area_of (planned.roi) / kJobsOfView + 1;
  std::uint64_t pixels = enough; /* of the last job */
  for (std::size_t i = 0; i < planned.slice_count; i++) {
    const std::size_t slice = planned.first_slice + i;
    if (pixels >= enough) {
      jobs_.push_back ({view, slice, 0, {}});
      pixels = 0;
    }
    jobs_.back ().count++;
    pixels += area_of (place_of (slices_[slice].header));
  }
}

void
AccessUnitDecoder::run (
    Job &job, const RangeImage &image, const ConstRangeImage &older, SliceMemory &memory)
{
  for (const PlannedSlice &slice : std::span (slices_).subspan (job.first, job.count)) {
    const SliceHeader &header = slice.header;
    ReferencePair &pair = references_[header.view_id];
    ReferencePlane *now = header.reference ? pair.now_kept () : nullptr;
    const ReferencePlane &before = pair.before (header.frame_number);
    DecodedPixels decoded;
    if (decoder_.decode (slice.unit, header, {&before, now, &older}, image, decoded, memory)
            .ok ()) {
      job.result.slices++;
      job.result.points += decoded.points;
      job.result.unknown_pixels += decoded.unknown;
      continue;
    }
    job.result.bad_slices++;
    if (now)
      now->clear (header);
    fill_from (older, image, place_of (header));
  }
}

/* The result of a view's jobs. */
DecoderResult
AccessUnitDecoder::sum_up (std::size_t index) const
{
  const PlannedView &planned = planned_[index];
  DecoderResult sum;
  for (const Job &job : jobs_)
    if (job.view == index)
      sum += job.result;
  sum.missing_pixels = missing_pixels (index);
  const SliceHeader &first = planned.reference;
  sum.raw_bits =
      sum.points * static_cast<std::uint64_t> (first.depth_bits + 3 * first.colour_bits) +
      planned.coded_pixels;
  return sum;
}

Status
AccessUnitDecoder::decode (std::span<const RangeImage> images, int threads, DecoderResult &result,
    std::span<const RangeImage> older)
{
  if (!std::ranges::equal (images, views (), [] (const RangeImage &image, const PlannedView &view) {
        return image.view_id == view.view_id && image.roi == view.roi;
      }))
    return {StatusCode::kBadSize, "decoder: the images are not those of the planned views"};
  const auto older_of = [&] (std::size_t i) {
    const auto found = std::ranges::find (older, planned_[i].view_id, &RangeImage::view_id);
    return found == older.end () ? ConstRangeImage () : ConstRangeImage (*found);
  };
  in_parallel (count_, threads, [&] (std::size_t i) { begin_view (i, images[i], older_of (i)); });
  jobs_.clear ();
  for (std::size_t i = 0; i < count_; i++)
    add_jobs (i);
  const std::size_t workers = workers_for (jobs_.size (), threads);
  memory_.reserve (workers);
  in_parallel (jobs_.size (), static_cast<int> (workers), [&] (std::size_t i, std::size_t worker) {
    Job &job = jobs_[i];
    run (job, images[job.view], older_of (job.view), memory_.of (worker));
  });
  for (std::size_t i = 0; i < count_; i++)
    result += sum_up (i);
  return {};
}

void
fill_from (const ConstRangeImage &older, const RangeImage &image, const Roi &part)
{
  const Roi &a = older.roi, &b = image.roi;
  const int begin = part.x, end = part.x + part.width;
  const int left = std::clamp (a.x - b.x, begin, end);
  const int right = std::clamp (a.x + a.width - b.x, left, end);
  for (int y = part.y; y < part.y + part.height; y++) {
    std::uint16_t *depth = image.depth.row (y);
    const int from_y = b.y + y - a.y;
    if (from_y < 0 || from_y >= a.height || left == right) {
      std::fill (depth + begin, depth + end, kInvalidDepth);
      continue;
    }
    const int from_x = b.x + left - a.x;
    std::fill (depth + begin, depth + left, kInvalidDepth);
    std::copy_n (older.depth.row (from_y) + from_x, right - left, depth + left);
    std::copy_n (older.colour.row (from_y) + from_x, right - left, image.colour.row (y) + left);
    std::fill (depth + right, depth + end, kInvalidDepth);
  }
}

void
fill_from (const ConstRangeImage &older, const RangeImage &image)
{
  fill_from (older, image, {0, 0, image.roi.width, image.roi.height});
}

} // namespace rangecast
