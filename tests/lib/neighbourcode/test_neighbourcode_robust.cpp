/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What damage of one slice may do, in every profile, with and without reference to earlier frame
 * sets: in its own frame set and in those that follow. */
#include "neighbourcode-support.hpp"

#include <algorithm>
#include <functional>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

using Units = std::vector<std::vector<std::uint8_t>>;

constexpr int kBand = 64; /* rows of the image that are refreshed together, in images so small */
constexpr std::uint64_t kFrameNs = 1'000'000'000 / 15;
constexpr std::uint64_t kRefreshNs = 3 * kFrameNs;

struct Mode {
  Profile profile;
  bool temporal;
};

/* Settings under which the small views below take some slices: small profiles need more bits for
 * that where slices do not end with bands. */
EncoderSettings
settings_of (const Mode &mode)
{
  const bool is_small = mode.profile != Profile::kPlain;
  EncoderSettings settings{10, 6, 2, 2, 256, mode.profile};
  if (is_small)
    settings = {16, 8, 0, 0, 256, mode.profile};
  settings.temporal = mode.temporal;
  settings.refresh_period_ns = kRefreshNs;
  return settings;
}

/* One frame set as it was coded, and what came of it where nothing was lost. */
struct FrameSet {
  Units units;
  std::vector<SliceHeader> headers;
  Decoded good;
};

/* Most pixels are those of the frame set before, a column further. */
Picture
moving_picture (int id, const Roi &first, int frame)
{
  Picture picture (id, {first.x + frame, first.y, first.width, first.height}, 1, 4);
  std::mt19937 random (static_cast<unsigned> (frame));
  for (int i = 0; i < first.width * first.height / 10; i++) {
    const int x = int (random ()) & 0xffff, y = int (random ()) & 0xffff;
    std::uint16_t &depth = picture.depth.view ().at (x % first.width, y % first.height);
    depth = depth ? static_cast<std::uint16_t> (depth + random () % 100) : depth;
  }
  return picture;
}

/* Codes frame sets of some views that move. */
std::vector<FrameSet>
code (const Rig &rig, const std::vector<Roi> &rois, const EncoderSettings &settings, int frames)
{
  AccessUnitEncoder encoder;
  EXPECT_TRUE (encoder.configure (rig, settings).ok ());
  AccessUnitDecoder decoder;
  EXPECT_TRUE (decoder.set_rig (rig).ok ());
  std::vector<FrameSet> sets (static_cast<std::size_t> (frames));
  for (int frame = 0; frame < frames; frame++) {
    std::vector<Picture> pictures;
    std::vector<RangeImage> images;
    for (std::size_t i = 0; i < rois.size (); i++)
      pictures.push_back (moving_picture (int (i), rois[i], frame));
    for (Picture &picture : pictures) {
      images.push_back (picture.image ());
      images.back ().capture_time_ns = static_cast<std::uint64_t> (frame) * kFrameNs;
    }
    EncoderResult result;
    EXPECT_TRUE (encoder.encode (images, std::uint32_t (frame), 1, result).ok ());
    FrameSet &set = sets[std::size_t (frame)];
    set.units = units_of (encoder.bytes ());
    for (const auto &unit : set.units)
      EXPECT_TRUE (read_slice_header (unit, set.headers.emplace_back ()).ok ());
    set.good = decode_exact (decoder, joined (set.units));
    EXPECT_EQ (set.good.result.unknown_pixels + set.good.result.bad_slices, 0u);
  }
  return sets;
}

/* ---- what is right ---- */

enum class Pixel {
  kRight,
  kMissing, ///< it should be valid
  kWrong    ///< another depth or colour is shown
};

Pixel
compare (Picture *is, Picture &good, int x, int y)
{
  const auto depth = good.depth.view ().at (x, y);
  const auto shown = is ? is->depth.view ().at (x, y) : kInvalidDepth;
  if (shown == kInvalidDepth)
    return depth == kInvalidDepth ? Pixel::kRight : Pixel::kMissing;
  const Rgbx a = is->colour.view ().at (x, y), b = good.colour.view ().at (x, y);
  const bool same = shown == depth && a.r == b.r && a.g == b.g && a.b == b.b;
  return same ? Pixel::kRight : Pixel::kWrong;
}

/* Nothing is written beside the ROI: decode() fills it with 0x5a5a, the padding of rows with 0. */
bool
padding_is_untouched (Picture &picture)
{
  const auto view = picture.depth.view ();
  for (int y = 0; y + 1 < view.height; y++)
    for (int x = view.width; x < view.width + 3; x++)
      if (view.row (y)[x] != 0)
        return false;
  return true;
}

struct Counts {
  std::uint64_t right = 0, missing = 0, wrong = 0; ///< of the valid pixels; wrong: also of others
};
using Allowed = std::function<bool (int view_id, int x, int y, Pixel what)>; /* of the full image */

/* Each pixel is right, or else allowed to be what it is. */
::testing::AssertionResult
judge (Decoded &is, Decoded &good, const Allowed &allowed, Counts *counts = nullptr)
{
  for (Picture &picture : is.pictures)
    if (!padding_is_untouched (picture))
      return ::testing::AssertionFailure () << "wrote beside view " << picture.view_id;
  Counts own, &count = counts ? *counts : own;
  for (Picture &expected : good.pictures) {
    const auto found = std::ranges::find (is.pictures, expected.view_id, &Picture::view_id);
    Picture *one = found == is.pictures.end () ? nullptr : &*found;
    if (one && one->roi != expected.roi)
      return ::testing::AssertionFailure () << "another ROI of view " << expected.view_id;
    for (int y = 0; y < expected.roi.height; y++)
      for (int x = 0; x < expected.roi.width; x++) {
        const Pixel what = compare (one, expected, x, y);
        count.right += what == Pixel::kRight && expected.depth.view ().at (x, y) != kInvalidDepth;
        count.missing += what == Pixel::kMissing;
        count.wrong += what == Pixel::kWrong;
        const int column = x + expected.roi.x, row = y + expected.roi.y;
        if (what != Pixel::kRight && !allowed (expected.view_id, column, row, what))
          return ::testing::AssertionFailure ()
                 << "view " << expected.view_id << " at " << column << ", " << row << " is "
                 << (what == Pixel::kWrong ? "wrong" : "missing");
      }
  }
  return ::testing::AssertionSuccess ();
}

bool
nothing_but_right (int, int, int, Pixel)
{
  return false;
}

bool
not_wrong (int, int, int, Pixel what)
{
  return what == Pixel::kMissing;
}

/* Of a slice, in the full image. */
Roi
place_of (const SliceHeader &h)
{
  return {h.roi.x + h.first_column, h.roi.y + h.first_row, h.columns, h.rows};
}

bool
contains (const Roi &place, int x, int y)
{
  return x >= place.x && y >= place.y && x < place.x + place.width && y < place.y + place.height;
}

bool
shares_band (const Roi &place, int y)
{
  return !place.empty () && y / kBand >= place.y / kBand &&
         y / kBand <= (place.y + place.height - 1) / kBand;
}

/* Two views whose ROIs lie in three bands each, so that every frame set has three slices of each
 * at least: one that lies about the others' ROI is outvoted. */
struct Robust : ::testing::TestWithParam<Mode> {
  static constexpr int kFrames = 5;
  Rig rig;
  std::vector<FrameSet> sets;
  AccessUnitDecoder decoder;

  void SetUp () override
  {
    for (const int id : {0, 1})
      rig.views.push_back (ring_view (id, 90.0 * id, 0.8, 32, 200));
    const int wider = GetParam ().temporal ? 2 : 0; /* slices with a reference are smaller */
    sets = code (rig, {Roi{5, 40, 5 + wider, 100}, Roi{0, 54, 4 + wider, 80}},
        settings_of (GetParam ()), kFrames);
    ASSERT_TRUE (decoder.set_rig (rig).ok ());
    for (const FrameSet &set : sets)
      for (const int view : {0, 1})
        ASSERT_GE (std::ranges::count (set.headers, view, &SliceHeader::view_id), 3);
    const auto refers = [] (const SliceHeader &h) { return !h.key; };
    for (const int frame : {1, 2, 3, 4})
      ASSERT_EQ (
          std::ranges::any_of (sets[std::size_t (frame)].headers, refers), GetParam ().temporal);
  }
  /* Brings the decoder to where it has decoded all frame sets before this one. */
  void play_until (std::size_t frame)
  {
    decoder.reset_references ();
    if (GetParam ().temporal)
      for (std::size_t i = 0; i < frame; i++)
        (void)decode (decoder, joined (sets[i].units));
  }
  /* The frame sets behind a damaged one. Intra profiles: the next one is whole; else nothing shown
   * is wrong but what may be, and after the refresh period all is right. */
  ::testing::AssertionResult those_behind_are_right (std::size_t damaged, const Allowed &allowed)
  {
    const std::size_t whole_again =
        damaged + (GetParam ().temporal ? std::size_t (kRefreshNs / kFrameNs) : 1);
    for (std::size_t i = damaged + 1; i <= std::min (whole_again, sets.size () - 1); i++) {
      Decoded decoded = decode_exact (decoder, joined (sets[i].units));
      const auto result =
          judge (decoded, sets[i].good, i == whole_again ? Allowed (nothing_but_right) : allowed);
      if (!result)
        return ::testing::AssertionFailure ()
               << i - damaged << " frame sets behind the damage: " << result.message ();
    }
    return ::testing::AssertionSuccess ();
  }
  void flip (std::size_t frame, std::size_t k, std::size_t bit);
};

std::string
name_of (const ::testing::TestParamInfo<Mode> &info)
{
  const char *names[] = {"plain", "packed", "entropy"};
  return std::string (names[int (info.param.profile)]) + (info.param.temporal ? "_temporal" : "");
}

/* Flips one bit of a slice and decodes that frame set and those behind it.
 *
 * - In its own frame set pixels outside the slice, and outside the place that its header claims
 * now, are right. Only where the bit belongs to the version or the size of the unit, what follows
 * that unit may be missing, and where it claims another place, slices that it overlaps.
 * - If the decoder found the damage, no pixel of any frame set is wrong: they are right or missing.
 * - If it did not, pixels may be wrong in the slice and, later, in its bands of the image.
 * - Other bands and other views are right all the time, and all is within the refresh period. */
void
Robust::flip (std::size_t frame, std::size_t k, std::size_t bit)
{
  FrameSet &set = sets[frame];
  Units bad = set.units;
  bad[k][bit / 8] ^= 1 << bit % 8;
  SliceHeader claimed;
  const bool ends_access_unit = (bit >= 4 && bit < 8) || (bit >= 16 && bit < 32);
  const bool has_place = !ends_access_unit && read_slice_header (bad[k], claimed).ok ();
  const Roi was = place_of (set.headers[k]), is = has_place ? place_of (claimed) : Roi{};

  play_until (frame);
  Decoded decoded = decode_exact (decoder, joined (bad));
  const bool is_other_type = bit < 4;        /* and passed over */
  const bool moved = has_place && is != was; /* what it overlaps now may be missing */
  const bool found =
      !ends_access_unit && !moved && (decoded.result.bad_slices > 0 || is_other_type);
  const auto may_be_missing = [&] (int view_id, Pixel what) {
    const int own = set.headers[k].view_id;
    return what == Pixel::kMissing && (ends_access_unit ? view_id >= own : moved && view_id == own);
  };
  const bool own_frame_set_is_right =
      bool (judge (decoded, set.good, [&] (int view_id, int x, int y, Pixel what) {
        const bool inside =
            view_id == set.headers[k].view_id && (contains (was, x, y) || contains (is, x, y));
        return (inside && !(found && what == Pixel::kWrong)) || may_be_missing (view_id, what);
      }));
  EXPECT_TRUE (own_frame_set_is_right) << frame << ": bit " << bit << " of slice " << k;
  const auto behind = [&] (int view_id, int, int y, Pixel what) {
    const bool near =
        view_id == set.headers[k].view_id && (shares_band (was, y) || shares_band (is, y));
    return (near && !(found && what == Pixel::kWrong)) || may_be_missing (view_id, what);
  };
  EXPECT_TRUE (those_behind_are_right (frame, behind))
      << frame << ": bit " << bit << " of slice " << k << (found ? ", found" : ", not found");
}

} // namespace

INSTANTIATE_TEST_SUITE_P (All, Robust,
    ::testing::Values (Mode{Profile::kPlain, false}, Mode{Profile::kPacked, false},
        Mode{Profile::kEntropy, false}, Mode{Profile::kPacked, true},
        Mode{Profile::kEntropy, true}),
    name_of);

TEST_P (Robust, a_flipped_bit_damages_its_slice_and_what_refers_to_it_and_nothing_else)
{
  for (const std::size_t frame : {0, 1}) {
    if (frame > 0 && !GetParam ().temporal)
      break;
    for (std::size_t k = 0; k < sets[frame].units.size (); k++)
      for (std::size_t bit = 0; bit < 8 * sets[frame].units[k].size () && !HasFailure ();
           bit += bit < 8 * (kSliceHeaderSize + 8) ? 1 : 7)
        flip (frame, k, bit);
  }
}

TEST_P (Robust, every_truncated_prefix_shows_nothing_wrong_then_or_later)
{
  for (const std::size_t frame : {0, 1}) {
    const auto bytes = joined (sets[frame].units);
    for (std::size_t size = 0; size < bytes.size () && !HasFailure (); size++) {
      play_until (frame);
      Decoded decoded = decode_exact (decoder, std::span (bytes).first (size));
      std::size_t whole = 0, end = 0;
      while (end + sets[frame].units[whole].size () <= size)
        end += sets[frame].units[whole++].size ();
      EXPECT_EQ (decoded.result.slices, whole) << size;
      const auto lost = [&] (int view_id, int x, int y, Pixel what) {
        const auto came = [&] (const SliceHeader &h) {
          return h.view_id == view_id && contains (place_of (h), x, y);
        };
        return what == Pixel::kMissing &&
               std::none_of (sets[frame].headers.begin (),
                   sets[frame].headers.begin () + std::ptrdiff_t (whole), came);
      };
      EXPECT_TRUE (judge (decoded, sets[frame].good, lost)) << size;
      EXPECT_TRUE (those_behind_are_right (frame, not_wrong)) << size;
    }
  }
}

TEST_P (Robust, shuffled_and_duplicated_slices_give_the_same_pictures)
{
  std::mt19937 random (3);
  for (int i = 0; i < 50; i++) {
    decoder.reset_references ();
    for (FrameSet &set : sets) {
      Units units = set.units;
      for (std::size_t n = 0; n < set.units.size (); n++)
        units.push_back (set.units[random () % set.units.size ()]);
      std::shuffle (units.begin (), units.end (), random);
      Decoded decoded = decode_exact (decoder, joined (units));
      ASSERT_TRUE (judge (decoded, set.good, nothing_but_right));
      EXPECT_EQ (decoded.result.slices, set.units.size ());
      EXPECT_EQ (decoded.result.bad_slices, set.units.size ());
    }
  }
}

TEST_P (Robust, a_frame_set_that_comes_twice_changes_nothing)
{
  for (FrameSet &set : sets)
    for (int i = 0; i < 3; i++) {
      Decoded decoded = decode_exact (decoder, joined (set.units));
      EXPECT_TRUE (judge (decoded, set.good, nothing_but_right));
    }
}

TEST_P (Robust, slices_of_another_stream_cost_nothing_but_themselves)
{
  const auto strays =
      code (rig, {Roi{3, 30, 7, 110}, Roi{1, 54, 5, 90}}, settings_of (GetParam ()), kFrames);
  for (std::size_t first = 0; first < 3; first++) {
    decoder.reset_references ();
    for (std::size_t i = 0; i < sets.size (); i++) {
      /* Of each view two, of the same frame set and of another one; as many as it has they may not
       * be. */
      Units units = sets[i].units;
      const auto &from = strays[(i + first) % strays.size ()];
      units.insert (units.begin (), from.units.front ());
      units.insert (units.begin () + 1, from.units[1]);
      units.push_back (from.units.back ());
      Decoded decoded = decode_exact (decoder, joined (units));
      EXPECT_TRUE (judge (decoded, sets[i].good, nothing_but_right)) << first << " " << i;
      EXPECT_EQ (decoded.result.bad_slices, 3u);
    }
  }
}

TEST_P (Robust, a_unit_of_a_future_version_or_of_absurd_size_loses_what_follows_it_and_no_more)
{
  struct Case {
    std::uint8_t first_byte;
    std::uint16_t size;
  };
  constexpr int kNext = kBitstreamVersion + 1;
  for (const Case &one : {Case{kNext << 4 | 1, 8}, {15 << 4, 8}, {kBitstreamVersion << 4 | 1, 0},
           {kBitstreamVersion << 4 | 1, 3}, {kBitstreamVersion << 4 | 1, 65535},
           {kBitstreamVersion << 4 | 9, 60000}})
    for (std::size_t at = 0; at <= sets[1].units.size (); at++) {
      Units units = sets[1].units;
      units.insert (units.begin () + std::ptrdiff_t (at),
          {one.first_byte, 1, static_cast<std::uint8_t> (one.size),
              static_cast<std::uint8_t> (one.size >> 8), 0, 0, 0, 0});
      play_until (1);
      Decoded decoded = decode_exact (decoder, joined (units));
      EXPECT_EQ (decoded.result.slices, at);
      EXPECT_EQ (decoded.result.bad_slices, 1u);
      EXPECT_TRUE (judge (decoded, sets[1].good, not_wrong));
      EXPECT_TRUE (those_behind_are_right (1, not_wrong));
    }
}

TEST_P (Robust, slices_that_claim_absurd_places_are_as_if_lost)
{
  for (const std::size_t at : {20u, 22u, 24u, 26u, 28u, 30u, 32u, 34u}) /* ROI, rows, columns */
    for (const int value : {0x7fff, 0xffff})
      for (std::size_t k = 0; k < sets[1].units.size (); k++) {
        Units units = sets[1].units;
        units[k][at] = static_cast<std::uint8_t> (value);
        units[k][at + 1] = static_cast<std::uint8_t> (value >> 8);
        play_until (1);
        Decoded decoded = decode_exact (decoder, joined (units));
        EXPECT_EQ (decoded.result.bad_slices, 1u);
        const SliceHeader &header = sets[1].headers[k];
        EXPECT_TRUE (judge (decoded, sets[1].good, [&] (int view_id, int x, int y, Pixel what) {
          return what == Pixel::kMissing && view_id == header.view_id &&
                 contains (place_of (header), x, y);
        }));
        EXPECT_TRUE (those_behind_are_right (1, not_wrong));
      }
}

/* ---- loss of one slice in twenty ---- */

namespace {

constexpr int kLossy = 60; /* frame sets with losses */
constexpr std::size_t kOneIn = 20;
constexpr unsigned kSeeds[] = {1, 2, 3};

/* One view, in some hundred slices where nothing is rounded. */
struct Loss : ::testing::TestWithParam<Mode> {
  Rig rig;
  std::vector<FrameSet> sets;
  AccessUnitDecoder decoder;

  void SetUp () override
  {
    const bool temporal = GetParam ().temporal;
    rig.views.push_back (ring_view (0, 0, 0.8, 320, 200));
    EncoderSettings settings = settings_of (GetParam ());
    if (!temporal) {
      settings.depth_bits = 16;
      settings.colour_bits = 8;
      settings.depth_threshold = settings.colour_threshold = 0;
    }
    sets = code (rig, {Roi{5, 20, 200, 170}}, settings, temporal ? kLossy + 4 : kLossy);
    ASSERT_TRUE (decoder.set_rig (rig).ok ());
  }
  static std::vector<std::uint8_t> without (const FrameSet &set, const std::vector<bool> &lost)
  {
    Units units;
    for (std::size_t i = 0; i < set.units.size (); i++)
      if (!lost[i])
        units.push_back (set.units[i]);
    return joined (units);
  }
  static std::vector<bool> lose_at_random (const FrameSet &set, std::mt19937 &random)
  {
    std::vector<bool> lost (set.units.size ());
    for (std::size_t i = 0; i < lost.size (); i++)
      lost[i] = random () % kOneIn == 0;
    return lost;
  }
  /* As many as one in twenty, no matter which. */
  static std::vector<bool> lose_exactly (const FrameSet &set, std::mt19937 &random)
  {
    std::vector<bool> lost (set.units.size ());
    std::fill_n (lost.begin (), lost.size () / kOneIn, true);
    std::shuffle (lost.begin (), lost.end (), random);
    return lost;
  }
  static Allowed missing_where_lost (const FrameSet &set, const std::vector<bool> &lost)
  {
    return [&] (int, int x, int y, Pixel what) {
      std::size_t i = 0;
      while (i < lost.size () && !contains (place_of (set.headers[i]), x, y))
        i++;
      return what == Pixel::kMissing && i < lost.size () && lost[i];
    };
  }
};
struct IntraLoss : Loss {};
struct TemporalLoss : Loss {};

} // namespace

INSTANTIATE_TEST_SUITE_P (All, IntraLoss,
    ::testing::Values (Mode{Profile::kPlain, false}, Mode{Profile::kPacked, false},
        Mode{Profile::kEntropy, false}),
    name_of);
INSTANTIATE_TEST_SUITE_P (All, TemporalLoss,
    ::testing::Values (Mode{Profile::kPacked, true}, Mode{Profile::kEntropy, true}), name_of);

TEST_P (IntraLoss, costs_the_pixels_of_the_lost_slices_and_the_next_frame_set_is_whole)
{
  for (const unsigned seed : kSeeds) {
    std::mt19937 random (seed);
    Counts counts;
    for (std::size_t i = 0; i + 1 < sets.size (); i++) {
      const auto lost = lose_at_random (sets[i], random);
      Decoded decoded = decode_exact (decoder, without (sets[i], lost));
      EXPECT_TRUE (judge (decoded, sets[i].good, missing_where_lost (sets[i], lost), &counts));
      Decoded next = decode_exact (decoder, joined (sets[i + 1].units));
      EXPECT_TRUE (judge (next, sets[i + 1].good, nothing_but_right));
    }
    EXPECT_GT (counts.missing, 0u);
    EXPECT_GE (double (counts.right) / double (counts.right + counts.missing), 0.94);
  }
}

TEST_P (IntraLoss, of_one_slice_in_twenty_leaves_94_percent_of_every_frame_set_right)
{
  double least = 1;
  for (const unsigned seed : kSeeds) {
    std::mt19937 random (seed);
    for (FrameSet &set : sets) {
      const auto lost = lose_exactly (set, random);
      ASSERT_GT (std::ranges::count (lost, true), 0);
      Decoded decoded = decode_exact (decoder, without (set, lost));
      Counts counts;
      EXPECT_TRUE (judge (decoded, set.good, missing_where_lost (set, lost), &counts));
      least = std::min (least, double (counts.right) / double (counts.right + counts.missing));
    }
  }
  RecordProperty ("least", std::to_string (least));
  EXPECT_GE (least, 0.94);
}

TEST_P (TemporalLoss, shows_nothing_wrong_and_is_gone_within_the_refresh_period)
{
  for (const unsigned seed : kSeeds) {
    std::mt19937 random (seed);
    Counts counts;
    std::size_t last = 0, whole = 0;
    decoder.reset_references ();
    for (std::size_t i = 0; i < sets.size (); i++) {
      const auto lost =
          i < kLossy ? lose_at_random (sets[i], random) : std::vector<bool> (sets[i].units.size ());
      if (std::ranges::count (lost, true) > 0)
        last = i;
      Decoded decoded = decode_exact (decoder, without (sets[i], lost));
      const bool is_gone = (i - last) * kFrameNs >= kRefreshNs;
      EXPECT_TRUE (
          judge (decoded, sets[i].good, is_gone ? Allowed (nothing_but_right) : not_wrong, &counts))
          << i - last << " behind the last loss";
      whole += is_gone;
    }
    EXPECT_GT (counts.missing, 0u);
    EXPECT_GT (whole, 0u);
    RecordProperty (
        "right", std::to_string (double (counts.right) / double (counts.right + counts.missing)));
  }
}
