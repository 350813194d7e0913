/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "access_unit.hpp"

#include <algorithm>
#include <opencv2/core/utility.hpp>
#include <utility>

namespace rangecast {

/* Runs work (i) for i below n, some at a time; threads 0 = number of cores. */
template <typename Work>
static void
in_parallel (std::size_t n, int threads, const Work &work)
{
  if (threads == 1 || n < 2) {
    for (std::size_t i = 0; i < n; i++)
      work (i);
    return;
  }
  cv::parallel_for_ (
      cv::Range (0, static_cast<int> (n)),
      [&] (const cv::Range &range) {
        for (int i = range.start; i < range.end; i++)
          work (static_cast<std::size_t> (i));
      },
      threads > 0 ? threads : -1.0);
}

/* ---- encoder ---- */

Status
AccessUnitEncoder::configure (const Rig &rig, const EncoderSettings &settings)
{
  double error = 0;
  for (const View &view : rig.views) {
    ViewEncoder &encoder = views_[view.id];
    if (Status s = encoder.configure (view, settings); !s.ok ())
      return s;
    error = std::max (error, encoder.depth ().max_error () * view.depth_unit_m);
  }
  rig_ = rig;
  settings_ = settings;
  max_depth_error_m_ = error;
  return {};
}

Status
AccessUnitEncoder::encode (std::span<const RangeImage> images, std::uint32_t frame_number,
    int threads, EncoderResult &result)
{
  count_ = 0;
  for (const RangeImage &image : images)
    if (!rig_.find (image.view_id))
      return {StatusCode::kNotFound, "range buffer: view " + std::to_string (image.view_id) +
                                         " is not in the rig of the caps"};
  in_parallel (images.size (), threads, [&] (std::size_t i) {
    Work &work = work_[i];
    work.bytes.clear ();
    work.result = {};
    work.status =
        views_[images[i].view_id].encode (images[i], frame_number, work.bytes, work.result);
  });
  for (std::size_t i = 0; i < images.size (); i++) {
    const Work &work = work_[i];
    if (!work.status.ok ())
      return work.status;
    result.points += work.result.points;
    result.full_pixels += work.result.full_pixels;
    result.slices += work.result.slices;
    result.raw_bits += work.result.raw_bits;
  }
  count_ = images.size ();
  return {};
}

std::size_t
AccessUnitEncoder::size () const
{
  std::size_t size = 0;
  for (std::size_t i = 0; i < count_; i++)
    size += work_[i].bytes.size ();
  return size;
}

/* ---- decoder ---- */

Status
AccessUnitDecoder::set_rig (const Rig &rig)
{
  if (Status s = header_reader_.set_rig (rig); !s.ok ())
    return s;
  for (const View &view : rig.views)
    if (Status s = decoders_[view.id].set_rig ({{view}}); !s.ok ())
      return s;
  rig_ = rig;
  count_ = 0;
  return {};
}

void
AccessUnitDecoder::plan (std::span<const std::uint8_t> bytes, DecoderResult &result)
{
  slices_.clear ();
  count_ = 0;
  UnitReader units (bytes);
  UnitHeader unit_header;
  while (const auto unit = units.next (unit_header)) {
    if (unit_header.type != static_cast<std::uint8_t> (UnitType::kSlice))
      continue;
    PlannedSlice slice = {*unit, {}};
    if (header_reader_.read_header (*unit, slice.header).ok ())
      slices_.push_back (slice);
    else
      result.bad_slices++;
  }
  result.bad_slices += !units.status ().ok ();

  std::ranges::stable_sort (slices_, {}, [] (const PlannedSlice &s) { return s.header.view_id; });
  for (std::size_t i = 0; i < slices_.size (); i++) {
    const SliceHeader &header = slices_[i].header;
    if (count_ == 0 || planned_[count_ - 1].view_id != header.view_id)
      planned_[count_++] = {header.view_id, header.roi, header.capture_time_ns, i, 0, header};
    planned_[count_ - 1].slice_count++;
  }
  for (std::size_t i = 0; i < count_; i++) {
    const auto first = slices_.begin () + std::ptrdiff_t (planned_[i].first_slice);
    std::ranges::sort (
        first, first + std::ptrdiff_t (planned_[i].slice_count), {}, [] (const PlannedSlice &s) {
          return std::pair{s.header.first_column, s.header.first_row};
        });
  }
}

static bool
same_place (const SliceHeader &a, const SliceHeader &b)
{
  return a.first_row == b.first_row && a.rows == b.rows && a.first_column == b.first_column &&
         a.columns == b.columns;
}

static bool
agrees (const SliceHeader &a, const SliceHeader &b)
{
  return a.roi == b.roi && a.depth_bits == b.depth_bits && a.colour_bits == b.colour_bits &&
         a.frame_number == b.frame_number;
}

/* The slices lie in the order of their columns, then rows. What an encoder makes is bands of
 * columns side by side, each of rows without a gap; whatever else they are (some lost, overlapping,
 * of other shapes) leaves pixels unwritten for all we know. */
std::uint64_t
AccessUnitDecoder::missing_pixels (std::size_t view) const
{
  const PlannedView &planned = planned_[view];
  const int width = planned.roi.width, height = planned.roi.height;
  const SliceHeader *last = nullptr;
  std::uint64_t have = 0;
  bool tiled = true;
  for (std::size_t i = 0; i < planned.slice_count; i++) {
    const SliceHeader &h = slices_[planned.first_slice + i].header;
    if (!agrees (h, planned.reference) || (last && same_place (h, *last)))
      continue;
    const bool below = last && h.first_column == last->first_column && h.columns == last->columns &&
                       h.first_row == last->first_row + last->rows;
    const bool beside =
        h.first_row == 0 && (last ? h.first_column == last->first_column + last->columns &&
                                        last->first_row + last->rows == height
                                  : h.first_column == 0);
    tiled &= below || beside;
    have += static_cast<std::uint64_t> (h.rows) * static_cast<std::uint64_t> (h.columns);
    last = &h;
  }
  if (planned.roi.empty () || (tiled && last && last->first_row + last->rows == height &&
                                  last->first_column + last->columns == width))
    return 0;
  const auto all = static_cast<std::uint64_t> (width) * static_cast<std::uint64_t> (height);
  return all > have ? all - have : 1;
}

void
AccessUnitDecoder::decode_view (std::size_t index, const RangeImage &image)
{
  const PlannedView &planned = planned_[index];
  const SliceHeader &first = planned.reference;
  DecoderResult &result = results_[index];
  result = {};
  for (std::size_t i = 0; i < planned.slice_count; i++) {
    const PlannedSlice &slice = slices_[planned.first_slice + i];
    if (!agrees (slice.header, first)) { /* a stray one: nothing of it is written */
      result.bad_slices++;
      continue;
    }
    std::uint64_t points = 0;
    if (decoders_[planned.view_id].decode (slice.unit, slice.header, image, points).ok ()) {
      result.slices++;
      result.points += points;
    } else {
      result.bad_slices++;
      SliceDecoder::invalidate (slice.header, image);
    }
  }
  result.missing_pixels = missing_pixels (index);
  result.raw_bits =
      result.points * static_cast<std::uint64_t> (first.depth_bits + 3 * first.colour_bits) +
      static_cast<std::uint64_t> (planned.roi.width) *
          static_cast<std::uint64_t> (planned.roi.height);
}

void
AccessUnitDecoder::decode (std::span<const RangeImage> images, int threads, DecoderResult &result)
{
  const std::size_t n = std::min (images.size (), count_);
  in_parallel (n, threads, [&] (std::size_t i) { decode_view (i, images[i]); });
  for (std::size_t i = 0; i < n; i++) {
    const DecoderResult &r = results_[i];
    result.slices += r.slices;
    result.bad_slices += r.bad_slices;
    result.missing_pixels += r.missing_pixels;
    result.points += r.points;
    result.raw_bits += r.raw_bits;
  }
}

void
fill_from (const ConstRangeImage &older, const RangeImage &image)
{
  const Roi &a = older.roi, &b = image.roi;
  const int left = std::clamp (a.x - b.x, 0, b.width);
  const int right = std::clamp (a.x + a.width - b.x, left, b.width);
  for (int y = 0; y < b.height; y++) {
    std::uint16_t *depth = image.depth.row (y);
    const int from_y = b.y + y - a.y;
    if (from_y < 0 || from_y >= a.height || left == right) {
      std::fill_n (depth, b.width, kInvalidDepth);
      continue;
    }
    const int from_x = b.x + left - a.x;
    std::fill (depth, depth + left, kInvalidDepth);
    std::copy_n (older.depth.row (from_y) + from_x, right - left, depth + left);
    std::copy_n (older.colour.row (from_y) + from_x, right - left, image.colour.row (y) + left);
    std::fill (depth + right, depth + b.width, kInvalidDepth);
  }
}

} // namespace rangecast
