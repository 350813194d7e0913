/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "access_unit.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "../parallel.hpp"

namespace rangecast {

/* ---- encoder ---- */

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

/* Mostly all views have the same near and far, and one is enough. */
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
AccessUnitEncoder::encode (std::span<const RangeImage> images, std::uint32_t frame_number,
    int threads, EncoderResult &result)
{
  count_ = 0;
  std::uint64_t there = 0;
  for (const RangeImage &image : images) {
    if (!rig_.find (image.view_id))
      return {StatusCode::kNotFound, "range buffer: view " + std::to_string (image.view_id) +
                                         " is not in the rig of the caps"};
    if (there >> image.view_id & 1)
      return {StatusCode::kBadData,
          "range buffer: view " + std::to_string (image.view_id) + " is there twice"};
    there |= std::uint64_t{1} << image.view_id;
  }
  /* A view that is not there has nothing to refer to when it comes again: else a frame set of key
   * slices would not be one at which a decoder can begin. */
  for (const View &view : rig_.views)
    if (!(there >> view.id & 1))
      views_[view.id].request_key ();
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
    result += work.result;
  }
  count_ = images.size ();
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
  references_ = {}; /* memory, too: views may be others */
  rig_ = rig;
  count_ = 0;
  return {};
}

void
AccessUnitDecoder::forget_references ()
{
  for (ReferencePair &pair : references_)
    pair.forget ();
}

/* What slices of one view agree in, then where they lie, then when they came. */
static auto
sort_key (const SliceHeader &h)
{
  return std::tuple{h.view_id, h.roi.x, h.roi.y, h.roi.width, h.roi.height, h.depth_bits,
      h.inverse_depth, h.colour_bits, h.frame_number, h.reference, h.profile == Profile::kPlain,
      h.first_column, h.first_row, h.columns, h.rows};
}

static bool
agrees (const SliceHeader &a, const SliceHeader &b)
{
  return a.roi == b.roi && a.depth_bits == b.depth_bits && a.inverse_depth == b.inverse_depth &&
         a.colour_bits == b.colour_bits && a.frame_number == b.frame_number &&
         a.reference == b.reference &&
         (a.profile == Profile::kPlain) == (b.profile == Profile::kPlain);
}

static bool
same_place (const SliceHeader &a, const SliceHeader &b)
{
  return a.first_row == b.first_row && a.rows == b.rows && a.first_column == b.first_column &&
         a.columns == b.columns;
}

static Roi
place_of (const SliceHeader &h)
{
  return {h.first_column, h.first_row, h.columns, h.rows};
}

static std::uint64_t
area_of (const Roi &roi)
{
  return static_cast<std::uint64_t> (roi.width) * static_cast<std::uint64_t> (roi.height);
}

/* The elements at the beginning of `all` that are like its first one. */
template <typename T, typename Like>
static std::span<const T>
leading (std::span<const T> all, const Like &like)
{
  std::size_t n = 0;
  while (n < all.size () && like (all[n].header, all[0].header))
    n++;
  return all.first (n);
}

void
AccessUnitDecoder::plan (
    std::span<const std::uint8_t> bytes, DecoderResult &result, bool whole_rois)
{
  slices_.clear ();
  count_ = 0;
  UnitReader units (bytes);
  UnitHeader unit_header;
  while (const auto unit = units.next (unit_header)) {
    if (unit_header.type != static_cast<std::uint8_t> (UnitType::kSlice))
      continue;
    PlannedSlice slice = {*unit, {}, slices_.size (), false};
    if (!header_reader_.read_header (*unit, slice.header).ok ()) {
      result.bad_slices++;
      continue;
    }
    slice.too_short = SliceDecoder::smallest_size (slice.header) > unit->size ();
    slices_.push_back (slice);
  }
  result.bad_slices += !units.status ().ok ();

  std::ranges::sort (slices_, {}, [] (const PlannedSlice &s) {
    return std::pair{sort_key (s.header), s.arrival};
  });
  for (std::span<const PlannedSlice> rest = slices_; !rest.empty ();) {
    const auto view = leading (rest, [] (auto &a, auto &b) { return a.view_id == b.view_id; });
    plan_view (view, result);
    if (!whole_rois)
      crop_to_slices (planned_[count_ - 1]);
    rest = rest.subspan (view.size ());
  }
}

/* Most slices of a view are right, also where a stray one of another frame set came first. */
void
AccessUnitDecoder::plan_view (std::span<const PlannedSlice> slices, DecoderResult &result)
{
  const auto by_arrival = [] (const PlannedSlice &s) { return s.arrival; };
  std::span<const PlannedSlice> best;
  const PlannedSlice *best_first = nullptr;
  for (auto rest = slices; !rest.empty ();) {
    const auto run = leading (rest, agrees);
    const PlannedSlice *first = &*std::ranges::min_element (run, {}, by_arrival);
    if (run.size () > best.size () ||
        (run.size () == best.size () && first->arrival < best_first->arrival)) {
      best = run;
      best_first = first;
    }
    rest = rest.subspan (run.size ());
  }
  result.bad_slices += slices.size () - best.size ();
  const SliceHeader &header = best_first->header;
  planned_[count_++] = {header.view_id, header.roi, header.capture_time_ns,
      static_cast<std::size_t> (best.data () - slices_.data ()), best.size (), header,
      area_of (header.roi)};
  limit_pixels (planned_[count_ - 1]);
}

/* An encoder gives no pixel to two slices, and a network repeats packets a few times at most. Of
 * more than that a few bytes each would keep the decoder busy for minutes. */
constexpr std::uint64_t kMostRepeats = 8;

void
AccessUnitDecoder::limit_pixels (const PlannedView &planned)
{
  std::uint64_t pixels = 0;
  for (PlannedSlice &slice : std::span (&slices_[planned.first_slice], planned.slice_count)) {
    if (slice.too_short)
      continue;
    pixels += static_cast<std::uint64_t> (slice.header.rows) *
              static_cast<std::uint64_t> (slice.header.columns);
    slice.too_short = pixels > kMostRepeats * planned.coded_pixels;
  }
}

/* An encoder of profile plain gives at most 8/3 pixels a byte, so this is no ROI of which less than
 * nine tenths are lost: it stays as it is, the same from one frame set to the next. In other
 * profiles it may shrink with fewer losses where little moves. */
static constexpr std::uint64_t kMaxPixelsPerByte = 32;

void
AccessUnitDecoder::crop_to_slices (PlannedView &planned)
{
  const std::span<PlannedSlice> slices (&slices_[planned.first_slice], planned.slice_count);
  int left = planned.roi.width, top = planned.roi.height, right = 0, bottom = 0;
  std::uint64_t bytes = 0;
  for (const PlannedSlice &slice : slices) {
    bytes += slice.unit.size ();
    if (slice.too_short)
      continue;
    const Roi place = place_of (slice.header);
    left = std::min (left, place.x);
    top = std::min (top, place.y);
    right = std::max (right, place.x + place.width);
    bottom = std::max (bottom, place.y + place.height);
  }
  if (planned.coded_pixels <= kMaxPixelsPerByte * bytes)
    return;
  planned.roi = right == 0
                    ? Roi{}
                    : Roi{planned.roi.x + left, planned.roi.y + top, right - left, bottom - top};
  for (PlannedSlice &slice : slices) {
    slice.header.roi = planned.roi;
    slice.header.first_column -= left;
    slice.header.first_row -= top;
  }
}

/* The slices lie in the order of their columns, then rows. What an encoder makes is bands of
 * columns side by side, each of rows without a gap; whatever else they are (some lost, overlapping,
 * of other shapes) leaves pixels unwritten for all we know. */
bool
AccessUnitDecoder::is_tiled (const PlannedView &planned, std::uint64_t &have) const
{
  const int width = planned.roi.width, height = planned.roi.height;
  const SliceHeader *last = nullptr;
  have = 0;
  bool tiled = true;
  for (std::size_t i = 0; i < planned.slice_count; i++) {
    const PlannedSlice &slice = slices_[planned.first_slice + i];
    const SliceHeader &h = slice.header;
    if (slice.too_short || (last && same_place (h, *last)))
      continue;
    const bool below = last && h.first_column == last->first_column && h.columns == last->columns &&
                       h.first_row == last->first_row + last->rows;
    const bool beside =
        h.first_row == 0 && (last ? h.first_column == last->first_column + last->columns &&
                                        last->first_row + last->rows == height
                                  : h.first_column == 0);
    tiled &= below || beside;
    have += area_of (place_of (h));
    last = &h;
  }
  return planned.roi.empty () || (tiled && last && last->first_row + last->rows == height &&
                                     last->first_column + last->columns == width);
}

std::uint64_t
AccessUnitDecoder::missing_pixels (std::size_t view) const
{
  const PlannedView &planned = planned_[view];
  std::uint64_t have;
  if (is_tiled (planned, have))
    return planned.coded_pixels - area_of (planned.roi);
  return planned.coded_pixels > have ? planned.coded_pixels - have : 1;
}

/* Slices of one place: the first sound one counts, the others are copies of it. */
AccessUnitDecoder::Place
AccessUnitDecoder::decode_place (std::span<const PlannedSlice> same, const RangeImage &image,
    const ConstRangeImage &older, DecoderResult &result)
{
  Place place = Place::kNothing;
  for (const PlannedSlice &slice : same) {
    const int id = slice.header.view_id;
    ReferencePair &pair = references_[id];
    ReferencePlane *now = slice.header.reference ? pair.now_kept () : nullptr;
    const ReferencePlane &before = pair.before (slice.header.frame_number);
    DecodedPixels decoded;
    if (!slice.too_short &&
        decoders_[id]
            .decode (slice.unit, slice.header, {&before, now, &older}, image, decoded)
            .ok ()) {
      result.slices++;
      result.points += decoded.points;
      result.unknown_pixels += decoded.unknown;
      return Place::kSound;
    }
    result.bad_slices++;
    if (slice.too_short)
      continue;
    place = Place::kDamaged;
    if (now)
      now->clear (slice.header);
  }
  if (place == Place::kDamaged)
    fill_from (older, image, place_of (same[0].header));
  return place;
}

/* Where slices may overlap, the sum of their points is not what is there. Touches only pixels that
 * came: a few small slices can claim a large image. */
void
AccessUnitDecoder::cover (Coverage &covered, Place place, const Roi &part, const RangeImage &image)
{
  for (int y = part.y; y < part.y + part.height; y++)
    for (int x = part.x; x < part.x + part.width; x++) {
      const auto i = static_cast<std::size_t> (y) * static_cast<std::size_t> (image.roi.width) +
                     static_cast<std::size_t> (x);
      const bool valid = place == Place::kSound && image.depth.at (x, y) != kInvalidDepth;
      covered.seen_pixels += !covered.seen[i];
      covered.points += valid;
      covered.points -= covered.valid[i];
      covered.seen[i] = true;
      covered.valid[i] = valid;
    }
}

void
AccessUnitDecoder::decode_view (
    std::size_t index, const RangeImage &image, const ConstRangeImage &older)
{
  const PlannedView &planned = planned_[index];
  DecoderResult &result = results_[index];
  Coverage &covered = covered_[index];
  result = {};
  if (planned.reference.reference)
    references_[planned.view_id].begin (planned.reference);
  std::uint64_t have;
  const bool tiled = is_tiled (planned, have);
  if (!tiled) {
    fill_from (older, image);
    covered.seen.assign (area_of (planned.roi), false);
    covered.valid.assign (area_of (planned.roi), false);
    covered.seen_pixels = covered.points = 0;
  }
  std::span<const PlannedSlice> rest (&slices_[planned.first_slice], planned.slice_count);
  while (!rest.empty ()) {
    const auto same = leading (rest, same_place);
    const Place place = decode_place (same, image, older, result);
    if (!tiled && place != Place::kNothing)
      cover (covered, place, place_of (same[0].header), image);
    rest = rest.subspan (same.size ());
  }
  if (!tiled)
    result.points = covered.points;
  result.missing_pixels =
      planned.coded_pixels - (tiled ? area_of (planned.roi) : covered.seen_pixels);
  const SliceHeader &first = planned.reference;
  result.raw_bits =
      result.points * static_cast<std::uint64_t> (first.depth_bits + 3 * first.colour_bits) +
      planned.coded_pixels;
}

static ConstRangeImage
image_of (std::span<const RangeImage> images, int view_id)
{
  for (const RangeImage &image : images)
    if (image.view_id == view_id)
      return image;
  return {}; /* an empty one: everything becomes invalid */
}

static bool
belongs_to (const RangeImage &image, const AccessUnitDecoder::PlannedView &planned)
{
  return image.view_id == planned.view_id && image.roi == planned.roi;
}

Status
AccessUnitDecoder::decode (std::span<const RangeImage> images, int threads, DecoderResult &result,
    std::span<const RangeImage> older)
{
  if (!std::ranges::equal (images, views (), belongs_to))
    return {StatusCode::kBadSize, "decoder: the images are not those of the planned views"};
  in_parallel (count_, threads,
      [&] (std::size_t i) { decode_view (i, images[i], image_of (older, planned_[i].view_id)); });
  for (std::size_t i = 0; i < count_; i++) {
    const DecoderResult &r = results_[i];
    result.slices += r.slices;
    result.bad_slices += r.bad_slices;
    result.missing_pixels += r.missing_pixels;
    result.points += r.points;
    result.raw_bits += r.raw_bits;
    result.unknown_pixels += r.unknown_pixels;
  }
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
