/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "access_unit.hpp"

namespace rangecast {

Status
AccessUnitEncoder::configure (const Rig &rig, const EncoderSettings &settings)
{
  for (const View &view : rig.views)
    if (Status s = views_[view.id].configure (view, settings); !s.ok ())
      return s;
  rig_ = rig;
  settings_ = settings;
  find_max_depth_error ();
  return {};
}

void
AccessUnitEncoder::set_thresholds (int depth, int colour)
{
  const bool same_depth = depth == settings_.depth_threshold;
  settings_.depth_threshold = depth;
  settings_.colour_threshold = colour;
  for (const View &view : rig_.views)
    views_[view.id].set_thresholds (depth, colour);
  if (!same_depth)
    find_max_depth_error ();
}

/* Usually all views have the same near and far, and the error is computed once. */
void
AccessUnitEncoder::find_max_depth_error ()
{
  max_depth_error_m_ = 0;
  const View *last = nullptr;
  for (const View &view : rig_.views) {
    if (last && view.near_m == last->near_m && view.far_m == last->far_m &&
        view.depth_unit_m == last->depth_unit_m)
      continue;
    const int error = views_[view.id].depth ().max_error (settings_.depth_threshold);
    max_depth_error_m_ = std::max (max_depth_error_m_, error * view.depth_unit_m);
    last = &view;
  }
}

Status
AccessUnitEncoder::check_views (std::span<const RangeImage> images)
{
  std::uint64_t present = 0; /* by view-id */
  for (const RangeImage &image : images) {
    if (!rig_.find (image.view_id))
      return {StatusCode::kNotFound, "range buffer: view " + std::to_string (image.view_id) +
                                         " is not in the rig of the caps"};
    if (present >> image.view_id & 1)
      return {StatusCode::kBadData,
          "range buffer: view " + std::to_string (image.view_id) + " is there twice"};
    present |= std::uint64_t{1} << image.view_id;
  }
  /* A view that is absent begins with key slices when it returns: otherwise a frame set of key
   * slices might not be one at which a decoder can begin. */
  for (const View &view : rig_.views)
    if (!(present >> view.id & 1))
      views_[view.id].request_key ();
  return {};
}

Status
AccessUnitEncoder::encode (std::span<const RangeImage> images, std::uint32_t frame_number,
    int threads, EncoderResult &result)
{
  parts_.clear ();
  jobs_.clear ();
  if (Status s = check_views (images); !s.ok ())
    return s;
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    begun_[i] = views_[images[i].view_id].begin (images[i], frame_number);
  });
  for (std::size_t i = 0; i < images.size (); i++)
    if (!begun_[i].ok ()) {
      request_key (); /* the other views' references are of a frame set that is never sent */
      return begun_[i];
    }
  const auto add_jobs = [this] (ViewEncoder &view) {
    view.for_open_partitions ([&] (ViewEncoder::PartitionId partition) {
      jobs_.push_back ({&view, partition});
    });
  };
  for (const RangeImage &image : images)
    add_jobs (views_[image.view_id]);
  do {
    const std::size_t workers = workers_for (jobs_.size (), threads);
    memory_.reserve (workers);
    in_parallel (
        jobs_.size (), static_cast<int> (workers), [&] (std::size_t i, std::size_t worker) {
          jobs_[i].view->code (jobs_[i].partition, memory_.of (worker));
        });
    jobs_.clear ();
    for (const RangeImage &image : images)
      if (ViewEncoder &view = views_[image.view_id]; !view.finish ())
        add_jobs (view);
  } while (!jobs_.empty ());
  for (const RangeImage &image : images) {
    const ViewEncoder &view = views_[image.view_id];
    result += view.result ();
    view.for_coded_partitions (
        [&] (std::span<const std::uint8_t> bytes) { parts_.push_back (bytes); });
  }
  return {};
}

void
AccessUnitEncoder::request_key ()
{
  for (ViewEncoder &view : views_)
    view.request_key ();
}

std::size_t
AccessUnitEncoder::size () const
{
  std::size_t size = 0;
  for (const auto part : parts_)
    size += part.size ();
  return size;
}

std::vector<std::uint8_t>
AccessUnitEncoder::bytes () const
{
  std::vector<std::uint8_t> bytes;
  bytes.reserve (size ());
  for (const auto part : parts_)
    bytes.insert (bytes.end (), part.begin (), part.end ());
  return bytes;
}

} // namespace rangecast
