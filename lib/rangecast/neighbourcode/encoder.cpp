/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encoder.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "bitstream/symbols.hpp"

namespace rangecast {
namespace {

/* Profile plain: the fewest partitions for which every possible row fits into a slice. */
int
plain_partitions (const SliceHeader &header, int max_slice_size)
{
  const int bits = kSymbolBits + header.depth_bits + 3 * header.colour_bits;
  /* Symbols and full pixels may each end within a byte. */
  const int overhead = int (kSliceHeaderSize) + 2;
  const int max_columns = (max_slice_size - overhead) * 8 / bits;
  return (header.roi.width + max_columns - 1) / max_columns;
}

/* Profiles packed and entropy: an estimate, as a row may still not fit. Without a reference a slice
 * has so many columns for each byte^(1/2) of its size; the factors were found by experiment.
 * Entropy slices are about as wide as high, so that few pixels lack their upper neighbours; packed
 * ones are wider, so that few runs begin. Without loss rows are long and slices low. With a
 * reference slices are as high as their band, if the last bands tell how wide that is.
 * @param is_exact  all residuals are coded without loss
 * @param delta_bytes_per_pixel  of the last bands with a reference; 0: there was none */
int
compact_partitions (const SliceHeader &header, const RowBand &band, int max_slice_size,
    bool is_exact, double delta_bytes_per_pixel)
{
  constexpr double kFillOfDeltaSlice = 0.8; /* so that few of them exceed their size */
  const double columns_of_slice =
      header.profile == Profile::kPacked ? (is_exact ? 1.4 : 4.5) : (is_exact ? 1 : 2.4);
  const int width = header.roi.width;
  double side = columns_of_slice * std::sqrt (max_slice_size);
  if (!band.key && delta_bytes_per_pixel > 0) {
    const double columns = kFillOfDeltaSlice * max_slice_size / (delta_bytes_per_pixel * band.rows);
    side = std::clamp (columns, side, double (std::max (width, int (side) + 1)));
  }
  return std::clamp (int (std::lround (width / side)), 1, width);
}

} // namespace

Status
validate (const EncoderSettings &s)
{
  const auto bad = [] (const char *what) { return Status{StatusCode::kBadValue, what}; };
  if (s.depth_bits < 6 || s.depth_bits > 16)
    return bad ("encoder: depth bits must be 6 to 16");
  if (s.colour_bits < 4 || s.colour_bits > 8)
    return bad ("encoder: colour bits must be 4 to 8");
  if (s.depth_threshold < 0 || s.depth_threshold > 65535 || s.colour_threshold < 0 ||
      s.colour_threshold > 255)
    return bad ("encoder: thresholds must be 0 to 65535 for depth and 0 to 255 for colour");
  if (s.max_slice_size < 256 || s.max_slice_size > int (kMaxUnitSize))
    return bad ("encoder: maximum slice size must be 256 to 65535 bytes");
  if (s.profile > Profile::kEntropy)
    return bad ("encoder: profile must be plain, packed or entropy");
  if (s.temporal && s.profile == Profile::kPlain)
    return bad ("encoder: temporal prediction needs profile packed or entropy");
  return {};
}

Status
ViewEncoder::configure (const View &view, const EncoderSettings &settings)
{
  const bool same_view = configured_ && encode_rig ({{view}}) == encode_rig ({{view_}});
  if (same_view && settings == settings_)
    return {};
  if (Status s = validate (settings); !s.ok ())
    return s;
  const bool same_codes = same_view && settings.depth_bits == settings_.depth_bits &&
                          settings.colour_bits == settings_.colour_bits;
  if (!same_codes) {
    if (Status s = depth_.set (view, settings.depth_bits); !s.ok ())
      return s;
    colour_ = ColourQuantiser (settings.colour_bits);
  }
  const bool comparable = same_codes && settings.profile == settings_.profile && settings.temporal;
  if (!same_view) {
    refresh_.reset (view.height, view.id);
    for (auto *rows : {&rows_, &fine_, &coarse_, &both_})
      rows->reserve (refresh_.bands ());
    plans_.reserve (refresh_.bands ());
    motions_.resize (view.width, view.height);
  }
  if (!comparable) {
    references_.reset ();
    reference_choice_.reset (refresh_.bands ());
  }
  view_ = view;
  settings_ = settings;
  configured_ = true;
  return {};
}

/* Begins to store the coded pixels if later frame sets may refer to them, and plans which rows
 * refer to the frame set before. */
void
ViewEncoder::plan_references ()
{
  reference_ = {};
  fine_.clear ();
  both_.clear ();
  coarse_.assign (1, {0, header_.roi.height, true, 0});
  header_.reference = settings_.temporal;
  if (settings_.temporal)
    references_.begin (header_);
  if (!settings_.temporal || !references_.now_kept ()) {
    header_.reference = false;
    return;
  }
  motions_.begin ();
  const ReferencePlane &before = references_.before ();
  const std::uint32_t distance = header_.frame_number - before.frame_number ();
  const bool key = !before.held () || distance == 0 || distance > 255;
  header_.reference_distance = key ? std::uint8_t{0} : static_cast<std::uint8_t> (distance);
  refresh_.plan (header_.roi,
      {header_.capture_time_ns, settings_.frame_interval_ns, settings_.refresh_period_ns}, key,
      rows_);
  reference_choice_.sort (rows_, fine_, coarse_, both_);
  reference_ = {&before, references_.now_kept ()};
}

CompactSettings
ViewEncoder::compact_settings (bool fine) const
{
  return {settings_.depth_threshold, settings_.colour_threshold, settings_.max_slice_size,
      settings_.choice == NeighbourChoice::kBest, fine};
}

int
ViewEncoder::partitions_of (const Plan &plan) const
{
  if (header_.roi.empty ())
    return 1;
  if (settings_.profile == Profile::kPlain)
    return plain_partitions (header_, settings_.max_slice_size);
  const CompactSettings finer = finer_settings (compact_settings (plan.fine));
  const bool is_exact =
      is_zero (steps_within (finer.depth_threshold, finer.colour_threshold).components () - 1);
  return compact_partitions (
      header_, plan.rows, settings_.max_slice_size, is_exact, delta_bytes_per_pixel_);
}

/* Cuts a band into partitions. Reserves memory for their usual size and for ROIs that grow, so that
 * frame sets allocate nothing in the steady state: with a reference there are at most as many
 * partitions as without, and partition i is no wider than one of i + 1. */
void
ViewEncoder::cut (Band &band, int partitions)
{
  constexpr std::size_t kUsualBytesOfPixel = 2;
  const int width = header_.roi.width;
  Plan key = band.plan;
  key.rows.key = true;
  const auto reserved = static_cast<std::size_t> (
      std::max (partitions, band.plan.rows.key ? 0 : partitions_of (key)));
  const int rows = settings_.temporal ? header_.roi.height : band.plan.rows.rows; /* bands merge */
  if (band.partitions.size () < reserved)
    band.partitions.resize (reserved);
  for (std::size_t i = 0; i < reserved; i++) {
    const std::size_t columns = static_cast<std::size_t> (width) / (i + 1) + 1;
    const std::size_t usual = kUsualBytesOfPixel * columns * static_cast<std::size_t> (rows);
    std::vector<std::uint8_t> &bytes = band.partitions[i].bytes;
    bytes.clear ();
    if (bytes.capacity () < usual)
      bytes.reserve (usual + usual / 2);
  }
  band.count = static_cast<std::size_t> (partitions);
  band.is_open = true;
  band.misfits = false;
  for (int i = 0; i < partitions; i++) {
    Partition &partition = band.partitions[static_cast<std::size_t> (i)];
    partition.first_column = width * i / partitions;
    partition.columns = width * (i + 1) / partitions - partition.first_column;
  }
}

void
ViewEncoder::cut_bands ()
{
  plans_.clear ();
  for (const RowBand &rows : both_) {
    const bool delta = reference_choice_.expects_delta (rows);
    plans_.push_back ({{rows.first_row, rows.rows, delta, rows.index}, !delta, Trial::kFirst});
  }
  for (const RowBand &rows : fine_)
    plans_.push_back ({rows, true, Trial::kNone});
  for (const RowBand &rows : coarse_)
    plans_.push_back ({rows, false, Trial::kNone});
  std::ranges::sort (plans_, {}, [] (const Plan &plan) { return plan.rows.first_row; });
  band_count_ = plans_.size ();
  if (bands_.size () < band_count_)
    bands_.resize (band_count_);
  for (std::size_t i = 0; i < band_count_; i++) {
    bands_[i].plan = plans_[i];
    cut (bands_[i], partitions_of (plans_[i]));
  }
}

void
ViewEncoder::make_empty_slice ()
{
  fine_.clear ();
  both_.clear ();
  coarse_.assign (1, {0, 0, true, 0});
  cut_bands ();
  bands_[0].is_open = false;
  Partition &partition = bands_[0].partitions[0];
  partition.bytes.resize (kSliceHeaderSize);
  write_slice_header (header_, kSliceHeaderSize, partition.bytes.data ());
  partition.result = {};
  partition.result.slices = 1;
}

Status
ViewEncoder::begin (const ConstRangeImage &image, std::uint32_t frame_number)
{
  const Roi &roi = image.roi;
  band_count_ = 0;
  if (!configured_)
    return {StatusCode::kBadValue, "encoder: not configured"};
  if (!roi.empty () && (roi.x < 0 || roi.y < 0 || roi.x + roi.width > view_.width ||
                           roi.y + roi.height > view_.height))
    return {StatusCode::kBadSize,
        "view " + std::to_string (view_.id) + ": the ROI does not lie in the view's image"};
  image_ = image;
  header_ = {};
  header_.view_id = static_cast<std::uint8_t> (view_.id);
  header_.depth_bits = static_cast<std::uint8_t> (settings_.depth_bits);
  header_.colour_bits = static_cast<std::uint8_t> (settings_.colour_bits);
  header_.profile = settings_.profile;
  header_.frame_number = frame_number;
  header_.capture_time_ns = image.capture_time_ns;
  if (roi.empty ()) {
    references_.reset (); /* as if it were absent */
    make_empty_slice ();
    return {};
  }
  header_.roi = roi;
  plan_references ();
  cut_bands ();
  return {};
}

void
ViewEncoder::code (PartitionId id, PartitionEncoder &memory)
{
  Band &band = bands_[id.band];
  Partition &partition = band.partitions[id.partition];
  const std::atomic_ref misfits (band.misfits);
  partition.bytes.clear ();
  partition.result = {};
  if (misfits.load (std::memory_order_relaxed))
    return; /* the whole band has to be coded again */
  SliceHeader header = header_;
  header.key = band.plan.rows.key;
  header.reference_distance = header.key ? std::uint8_t{0} : header_.reference_distance;
  header.first_column = partition.first_column;
  header.columns = partition.columns;
  const PlainSettings plain = {
      settings_.depth_threshold, settings_.colour_threshold, settings_.max_slice_size};
  if (settings_.profile != Profile::kPlain) {
    const CompactPicture picture = {image_, reference_, {depth_, colour_},
        compact_settings (band.plan.fine), motions_, refresh_.band_rows ()};
    if (!memory.compact.code_partition (
            picture, band.plan.rows, header, partition.bytes, partition.result))
      misfits.store (true, std::memory_order_relaxed);
  } else {
    memory.plain.code_partition (
        image_, depth_, colour_, plain, header, partition.bytes, partition.result);
  }
}

std::size_t
ViewEncoder::bytes_of (const Band &band)
{
  std::size_t bytes = 0;
  for (const Partition &partition : std::span (band.partitions).first (band.count))
    bytes += partition.bytes.size ();
  return bytes;
}

std::size_t
ViewEncoder::pixels_of (const Band &band) const
{
  return static_cast<std::size_t> (band.plan.rows.rows) *
         static_cast<std::size_t> (header_.roi.width);
}

/* Evaluates a trial whose partitions are coded. @return false if the band is complete */
bool
ViewEncoder::continue_trial (Band &band)
{
  const bool was_key = band.plan.rows.key;
  if (band.plan.trial == Trial::kFirst) {
    band.first_bytes = bytes_of (band);
    band.plan.trial = Trial::kSecond;
  } else if (band.plan.trial == Trial::kSecond) {
    const std::size_t bytes = bytes_of (band);
    const std::size_t key_bytes = was_key ? bytes : band.first_bytes;
    const std::size_t delta_bytes = was_key ? band.first_bytes : bytes;
    reference_choice_.record_trial (band.plan.rows, delta_bytes, {key_bytes, pixels_of (band)});
    band.plan.trial = Trial::kAgain;
    if (was_key == (key_bytes <= delta_bytes))
      return false;
  } else {
    return false;
  }
  band.plan.rows.key = !was_key;
  band.plan.fine = was_key;
  cut (band, partitions_of (band.plan));
  return true;
}

bool
ViewEncoder::finish ()
{
  bool is_done = true;
  for (Band &band : std::span (bands_).first (band_count_)) {
    if (!band.is_open)
      continue;
    band.is_open = band.misfits;
    if (band.misfits)
      cut (band, std::min (2 * static_cast<int> (band.count), header_.roi.width));
    else
      band.is_open = continue_trial (band);
    is_done = is_done && !band.is_open;
  }
  if (is_done)
    record_bytes ();
  return is_done;
}

/* The sizes of bands tell how wide the next slices with a reference may be, and whether a reference
 * still pays. */
void
ViewEncoder::record_bytes ()
{
  std::size_t bytes = 0, pixels = 0;
  for (const Band &band : std::span (bands_).first (band_count_)) {
    const RowBand &rows = band.plan.rows;
    if (band.plan.fine && band.plan.trial == Trial::kNone)
      for (const RowBand &part : rows_) /* of several bands, as if they were alike */
        if (part.first_row >= rows.first_row && part.first_row < rows.first_row + rows.rows)
          reference_choice_.record_coded ({part.first_row, part.rows, rows.key, part.index},
              {bytes_of (band), pixels_of (band)});
    if (band.plan.rows.key)
      continue;
    bytes += bytes_of (band);
    pixels += pixels_of (band);
  }
  if (pixels > 0)
    delta_bytes_per_pixel_ = double (bytes) / double (pixels);
}

EncoderResult
ViewEncoder::result () const
{
  EncoderResult sum;
  for (const Band &band : std::span (bands_).first (band_count_))
    for (const Partition &partition : std::span (band.partitions).first (band.count))
      sum += partition.result;
  sum.raw_bits =
      sum.points * static_cast<std::uint64_t> (settings_.depth_bits + 3 * settings_.colour_bits) +
      static_cast<std::uint64_t> (header_.roi.width) *
          static_cast<std::uint64_t> (header_.roi.height);
  return sum;
}

} // namespace rangecast
