/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "access_unit.hpp"

#include <algorithm>

#include "bitstream/slice_place.hpp"

namespace rangecast {
namespace {

/* A view is decoded in at most so many jobs: each has enough slices that a hostile stream cannot
 * make too many jobs, and threads end at about the same time. */
constexpr std::uint64_t kJobsOfView = 32;

/* @param part  rows and columns of the ROI */
void
make_invalid (const RangeImage &image, const Roi &part)
{
  for (int y = part.y; y < part.y + part.height; y++)
    std::fill_n (image.depth.row (y) + part.x, part.width, kInvalidDepth);
}

} // namespace

Status
AccessUnitDecoder::set_rig (const Rig &rig)
{
  const bool same = encode_rig (rig) == encode_rig (decoder_.rig ());
  if (Status s = decoder_.set_rig (rig); !s.ok ())
    return s;
  if (same)
    reset_references ();
  else
    references_ = {}; /* memory of what other views need */
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
AccessUnitDecoder::begin_view (std::size_t index, const RangeImage &image)
{
  const PlannedView &planned = planned_[index];
  decoder_.prepare (planned.reference);
  if (planned.reference.reference)
    references_[planned.view_id].begin (planned.reference);
  if (planned.held_pixels != area_of (planned.roi)) /* not every pixel is coded */
    make_invalid (image, {0, 0, image.roi.width, image.roi.height});
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
AccessUnitDecoder::run (Job &job, const RangeImage &image, SliceMemory &memory)
{
  for (const PlannedSlice &slice : std::span (slices_).subspan (job.first, job.count)) {
    const SliceHeader &header = slice.header;
    ReferencePair &pair = references_[header.view_id];
    ReferencePlane *now = header.reference ? pair.now_kept () : nullptr;
    const ReferencePlane &before = pair.before (header.frame_number);
    DecodedPixels decoded;
    if (decoder_.decode (slice.unit, header, {&before, now}, image, decoded, memory).ok ()) {
      job.result.slices++;
      job.result.points += decoded.points;
      job.result.unknown_pixels += decoded.unknown;
      continue;
    }
    job.result.bad_slices++;
    if (now)
      now->clear (header);
    make_invalid (image, place_of (header));
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
AccessUnitDecoder::decode (std::span<const RangeImage> images, int threads, DecoderResult &result)
{
  if (!std::ranges::equal (images, views (), [] (const RangeImage &image, const PlannedView &view) {
        return image.view_id == view.view_id && image.roi == view.roi;
      }))
    return {StatusCode::kBadSize, "decoder: the images are not those of the planned views"};
  in_parallel (count_, threads, [&] (std::size_t i) { begin_view (i, images[i]); });
  jobs_.clear ();
  for (std::size_t i = 0; i < count_; i++)
    add_jobs (i);
  const std::size_t workers = workers_for (jobs_.size (), threads);
  memory_.reserve (workers);
  in_parallel (jobs_.size (), static_cast<int> (workers), [&] (std::size_t i, std::size_t worker) {
    Job &job = jobs_[i];
    run (job, images[job.view], memory_.of (worker));
  });
  for (std::size_t i = 0; i < count_; i++)
    result += sum_up (i);
  return {};
}

} // namespace rangecast
