/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What all profiles promise, and what damage may do to them. */
#include "neighbourcode-support.hpp"

#include <cstring>
#include <memory>
#include <rangecast/base/cpu.hpp>
#include <rangecast/neighbourcode/compact/packed_code.hpp>

using namespace rangecast;
using namespace rangecast::testing;

namespace {

const Rig &
rig ()
{
  static const Rig rig = ring_rig (2);
  return rig;
}

void
expect_same (Picture &a, Picture &b)
{
  ASSERT_EQ (a.roi, b.roi);
  for (int y = 0; y < a.roi.height; y++)
    for (int x = 0; x < a.roi.width; x++) {
      ASSERT_EQ (a.depth.view ().at (x, y), b.depth.view ().at (x, y)) << x << " " << y;
      const Rgbx p = a.colour.view ().at (x, y), q = b.colour.view ().at (x, y);
      if (a.depth.view ().at (x, y)) {
        ASSERT_EQ (p.r, q.r) << x << " " << y;
        ASSERT_EQ (p.g, q.g) << x << " " << y;
        ASSERT_EQ (p.b, q.b) << x << " " << y;
      }
    }
}

struct Profiles : ::testing::TestWithParam<Profile> {
  AccessUnitDecoder decoder;
  void SetUp () override { ASSERT_TRUE (decoder.set_rig (rig ()).ok ()); }

  static EncoderSettings settings (int depth_bits, int colour_bits, int depth_threshold,
      int colour_threshold, int max_slice_size = 1200)
  {
    return {
        depth_bits, colour_bits, depth_threshold, colour_threshold, max_slice_size, GetParam ()};
  }
  static EncoderSettings lossless (int max_slice_size = 1200)
  {
    return settings (16, 8, 0, 0, max_slice_size);
  }
  static std::vector<std::uint8_t> small_stream ()
  {
    std::vector<Picture> pictures;
    pictures.emplace_back (0, Roi{7, 9, 24, 20}, 1, 6);
    pictures.emplace_back (1, Roi{0, 0, 16, 12}, 2, 6);
    return encode (rig (), pictures, settings (10, 6, 2, 2, 256));
  }
};

struct SmallProfiles : Profiles {};

std::string
name_of (const ::testing::TestParamInfo<Profile> &info)
{
  const char *const names[] = {"plain", "packed", "entropy"};
  return names[int (info.param)];
}

} // namespace

INSTANTIATE_TEST_SUITE_P (All, Profiles,
    ::testing::Values (Profile::kPlain, Profile::kPacked, Profile::kEntropy), name_of);

INSTANTIATE_TEST_SUITE_P (
    Both, SmallProfiles, ::testing::Values (Profile::kPacked, Profile::kEntropy), name_of);

TEST_P (Profiles, threshold_0_is_lossless)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{10, 20, 151, 133}, 1, 20);
  pictures.emplace_back (1, Roi{0, 0, 320, 240}, 2, 1);
  Decoded decoded = decode_exact (decoder, encode (rig (), pictures, lossless ()));
  ASSERT_EQ (decoded.pictures.size (), 2u);
  EXPECT_EQ (decoded.result.bad_slices, 0u);
  EXPECT_EQ (decoded.result.missing_pixels, 0u);
  expect_same (pictures[0], decoded.pictures[0]);
  expect_same (pictures[1], decoded.pictures[1]);
}

TEST_P (Profiles, noise_without_any_pattern_is_lossless_too)
{
  std::mt19937 random (7);
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{0, 0, 97, 61});
  for (int y = 0; y < 61; y++)
    for (int x = 0; x < 97; x++) {
      pictures[0].depth.view ().at (x, y) =
          random () % 3 ? static_cast<std::uint16_t> (3000 + random () % 12001) : 0;
      const auto any = [&] { return static_cast<std::uint8_t> (random ()); };
      pictures[0].colour.view ().at (x, y) = {any (), any (), any (), 0};
    }
  for (int limit : {256, 1200, 65535}) {
    Decoded decoded = decode_exact (decoder, encode (rig (), pictures, lossless (limit)));
    EXPECT_EQ (decoded.result.bad_slices, 0u);
    expect_same (pictures[0], decoded.pictures[0]);
  }
}

TEST_P (Profiles, differences_stay_within_thresholds_and_quantisation)
{
  for (int colour_bits : {4, 6, 8})
    for (int threshold : {1, 2, 3, 5, 10, 40, 255})
      for (NeighbourChoice choice : {NeighbourChoice::kFirst, NeighbourChoice::kBest}) {
        EncoderSettings s = settings (10, colour_bits, threshold, threshold);
        s.choice = choice;
        std::vector<Picture> pictures;
        pictures.emplace_back (0, Roi{0, 0, 160, 120}, 3, 25);
        Decoded decoded = decode_exact (decoder, encode (rig (), pictures, s));
        DepthQuantiser depth;
        ASSERT_TRUE (depth.set (rig ().views[0], 10).ok ());
        const double most_depth = (threshold + 0.5) * depth.step () + 1;
        const double most_colour = (threshold + 0.5) * 255 / ((1 << colour_bits) - 1) + 1;
        for (int y = 0; y < 120; y++)
          for (int x = 0; x < 160; x++) {
            const int a = pictures[0].depth.view ().at (x, y),
                      b = decoded.pictures[0].depth.view ().at (x, y);
            ASSERT_EQ (a == 0, b == 0);
            ASSERT_LE (std::abs (a - b), most_depth);
            const Rgbx p = pictures[0].colour.view ().at (x, y),
                       q = decoded.pictures[0].colour.view ().at (x, y);
            if (a) {
              ASSERT_LE (std::abs (p.r - q.r), most_colour) << threshold;
              ASSERT_LE (std::abs (p.g - q.g), most_colour) << threshold;
              ASSERT_LE (std::abs (p.b - q.b), most_colour) << threshold;
            }
          }
      }
}

TEST_P (SmallProfiles, smaller_than_plain_and_best_is_smaller_and_nearer_than_first)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{0, 0, 320, 240}, 3, 2);
  EncoderSettings s = {.profile = Profile::kPlain};
  const std::size_t plain = encode (rig (), pictures, s).size ();
  s.profile = GetParam ();
  s.colour_threshold = 8;
  const auto first = encode (rig (), pictures, s);
  s.choice = NeighbourChoice::kBest;
  const auto best = encode (rig (), pictures, s);
  EXPECT_LT (first.size (), plain / 2);
  EXPECT_LT (best.size (), first.size ());
  const auto error = [&] (std::span<const std::uint8_t> bytes) {
    Decoded decoded = decode_exact (decoder, bytes);
    double sum = 0;
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        if (pictures[0].depth.view ().at (x, y))
          sum += std::pow (pictures[0].colour.view ().at (x, y).g -
                               decoded.pictures[0].colour.view ().at (x, y).g,
              2);
    return sum;
  };
  EXPECT_LT (error (best), error (first));
}

TEST_P (Profiles, no_slice_exceeds_its_maximum)
{
  for (int limit : {256, 300, 1200, 65535}) {
    std::vector<Picture> pictures;
    pictures.emplace_back (0, Roi{3, 5, 317, 200}, 4, 50);
    const auto bytes = encode (rig (), pictures, lossless (limit));
    for (const auto &unit : units_of (bytes))
      EXPECT_LE (unit.size (), static_cast<std::size_t> (limit));
    Decoded decoded = decode_exact (decoder, bytes);
    EXPECT_EQ (decoded.result.missing_pixels, 0u);
    expect_same (pictures[0], decoded.pictures[0]);
  }
}

TEST_P (Profiles, slice_survives_loss_of_all_others)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{0, 0, 320, 240}, 4, 5);
  const auto units = units_of (encode (rig (), pictures, lossless ()));
  ASSERT_GT (units.size (), 10u);
  for (const auto &unit : units) {
    SliceHeader header;
    ASSERT_TRUE (read_slice_header (unit, header).ok ());
    EXPECT_EQ (header.profile, GetParam ());
    Decoded decoded = decode_exact (decoder, unit);
    ASSERT_EQ (decoded.result.slices, 1u);
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool inside = y >= header.first_row && y < header.first_row + header.rows &&
                            x >= header.first_column && x < header.first_column + header.columns;
        ASSERT_EQ (decoded.pictures[0].depth.view ().at (x, y),
            inside ? pictures[0].depth.view ().at (x, y) : 0);
      }
  }
}

TEST_P (SmallProfiles, empty_roi_is_one_small_slice_and_an_empty_picture_is_small)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{});
  const auto bytes = encode (rig (), pictures, settings (12, 8, 8, 10));
  EXPECT_EQ (bytes.size (), kSliceHeaderSize);
  EXPECT_EQ (decode_exact (decoder, bytes).result.slices, 1u);
  pictures.clear ();
  pictures.emplace_back (0, Roi{0, 0, 320, 240});
  for (int y = 0; y < 240; y++)
    std::fill_n (pictures[0].depth.view ().row (y), 320, kInvalidDepth);
  const auto nothing = encode (rig (), pictures, settings (12, 8, 8, 10));
  EXPECT_LT (nothing.size (), 400u);
  EXPECT_EQ (decode_exact (decoder, nothing).result.points, 0u);
}

TEST_P (Profiles, encoder_and_decoder_count_the_same)
{
  std::vector<Picture> pictures;
  pictures.emplace_back (0, Roi{0, 0, 200, 150});
  EncoderResult coded;
  const auto bytes = encode (rig (), pictures, settings (12, 8, 8, 10), &coded);
  const Decoded decoded = decode_exact (decoder, bytes);
  EXPECT_EQ (decoded.result.points, coded.points);
  EXPECT_EQ (decoded.result.slices, coded.slices);
  EXPECT_EQ (decoded.result.raw_bits, coded.raw_bits);
}

TEST_P (Profiles, noise_under_a_good_header_stays_in_its_rows_and_columns)
{
  const auto units = units_of (small_stream ());
  std::mt19937 random (2);
  for (int i = 0; i < 20000; i++) {
    auto unit = units[1];
    SliceHeader header;
    ASSERT_TRUE (read_slice_header (unit, header).ok ());
    const std::size_t begin = kSliceHeaderSize + (i % 2 ? 6 : 0); /* steps and orders too, or not */
    for (std::size_t k = begin; k < unit.size (); k++)
      unit[k] = static_cast<std::uint8_t> (random ());
    Picture canvas (header.view_id, header.roi);
    for (int y = 0; y < header.roi.height; y++)
      std::fill_n (canvas.depth.view ().row (y), header.roi.width, std::uint16_t{0xabcd});
    DecoderResult result;
    const auto copy = std::make_unique<std::uint8_t[]> (unit.size ());
    std::memcpy (copy.get (), unit.data (), unit.size ());
    decoder.plan ({copy.get (), unit.size ()}, result);
    ASSERT_EQ (decoder.views ().size (), 1u);
    const RangeImage image = canvas.image ();
    (void)decoder.decode ({&image, 1}, 1, result).ok ();
    for (int y = 0; y < header.roi.height; y++)
      for (int x = 0; x < header.roi.width; x++)
        if (y < header.first_row || y >= header.first_row + header.rows ||
            x < header.first_column || x >= header.first_column + header.columns) {
          ASSERT_EQ (canvas.depth.view ().at (x, y), kInvalidDepth);
        }
  }
}

TEST_P (Profiles, trailing_bytes_and_steps_of_0_are_damage)
{
  const auto good = units_of (small_stream ())[0];
  for (std::uint8_t byte : {0, 1}) {
    auto unit = good;
    unit.insert (unit.end (), 5, byte);
    unit[2] = static_cast<std::uint8_t> (unit[2] + 5);
    EXPECT_EQ (decode_exact (decoder, unit).result.bad_slices, 1u) << int (byte);
  }
  for (std::size_t at : {kSliceHeaderSize, kSliceHeaderSize + 2, kSliceHeaderSize + 3}) {
    if (GetParam () == Profile::kPlain)
      break; /* it has no steps */
    auto unit = good;
    unit[at] = 0;
    if (at == kSliceHeaderSize)
      unit[at + 1] = 0;
    EXPECT_EQ (decode_exact (decoder, unit).result.bad_slices, 1u) << at;
  }
}

TEST_P (Profiles, code_for_every_cpu_and_for_this_one_do_the_same)
{
  if (cpu_supports () < CpuLevel::kAvx2)
    GTEST_SKIP () << "this CPU has no AVX2";
  std::mt19937 random (7);
  for (int i = 0; i < 40; i++) {
    const auto below = [&] (unsigned n) { return static_cast<int> (random () % n); };
    std::vector<Picture> pictures;
    const Roi roi = {below (20), below (20), 1 + below (290), 1 + below (200)};
    pictures.emplace_back (0, roi, random (), below (60));
    EncoderSettings s =
        settings (6 + below (11), 4 + below (5), below (3) ? below (300) : below (65536),
            below (3) ? below (20) : below (256), 256 + below (2000));
    s.choice = i % 4 ? NeighbourChoice::kFirst : NeighbourChoice::kBest;
    const auto bytes = encode (rig (), pictures, s);
    Decoded here = decode_exact (decoder, bytes);
    limit_cpu (CpuLevel::kScalar);
    AccessUnitDecoder other;
    ASSERT_TRUE (other.set_rig (rig ()).ok ());
    const auto other_bytes = encode (rig (), pictures, s);
    Decoded there = decode_exact (other, bytes);
    limit_cpu (CpuLevel::kAvx2);
    ASSERT_EQ (bytes, other_bytes) << i;
    ASSERT_EQ (here.result.bad_slices + there.result.bad_slices, 0u) << i;
    expect_same (here.pictures[0], there.pictures[0]);
  }
}

/* Of a noisy surface that moves and comes nearer. */
TEST_P (SmallProfiles, slices_with_references_are_the_same_with_code_for_every_cpu)
{
  if (cpu_supports () < CpuLevel::kAvx2)
    GTEST_SKIP () << "this CPU has no AVX2";
  for (const NeighbourChoice choice : {NeighbourChoice::kFirst, NeighbourChoice::kBest}) {
    EncoderSettings s = settings (12, 8, 8, 5);
    s.temporal = true;
    s.choice = choice;
    AccessUnitEncoder encoders[2];
    AccessUnitDecoder decoders[2];
    for (int i = 0; i < 2; i++) {
      ASSERT_TRUE (encoders[i].configure (rig (), s).ok ());
      ASSERT_TRUE (decoders[i].set_rig (rig ()).ok ());
    }
    std::size_t references = 0;
    for (int frame = 0; frame < 6; frame++) {
      Picture picture (0, {10 + frame, 20, 151, 133}, 1, 10);
      for (int y = 0; y < 133; y++)
        for (int x = 0; x < 151; x++)
          if (std::uint16_t &depth = picture.depth.view ().at (x, y))
            depth = static_cast<std::uint16_t> (depth - frame * (10 + x / 4));
      const RangeImage image = picture.image ();
      std::vector<Decoded> decoded;
      for (int i = 0; i < 2; i++) {
        limit_cpu (i == 0 ? CpuLevel::kScalar : CpuLevel::kAvx2);
        EncoderResult result;
        ASSERT_TRUE (encoders[i].encode ({&image, 1}, std::uint32_t (frame), 1, result).ok ());
        decoded.push_back (decode_exact (decoders[i], encoders[0].bytes ()));
        EXPECT_EQ (decoded[std::size_t (i)].result.bad_slices, 0u);
      }
      ASSERT_EQ (encoders[0].bytes (), encoders[1].bytes ()) << frame;
      expect_same (decoded[0].pictures[0], decoded[1].pictures[0]);
      for (const auto &unit : units_of (encoders[0].bytes ())) {
        SliceHeader header;
        ASSERT_TRUE (read_slice_header (unit, header).ok ());
        references += !header.key;
      }
    }
    EXPECT_GT (references, 5u);
  }
}

TEST_P (Profiles, code_for_every_cpu_and_for_this_one_agree_on_damage)
{
  if (cpu_supports () < CpuLevel::kAvx2)
    GTEST_SKIP () << "this CPU has no AVX2";
  std::mt19937 random (8);
  const auto stream = small_stream ();
  for (int i = 0; i < 2000; i++) {
    auto bad = stream;
    for (int k = 0; k < 3; k++)
      bad[random () % bad.size ()] = static_cast<std::uint8_t> (random ());
    const Decoded here = decode_exact (decoder, bad);
    limit_cpu (CpuLevel::kScalar);
    AccessUnitDecoder other;
    ASSERT_TRUE (other.set_rig (rig ()).ok ());
    const Decoded there = decode_exact (other, bad);
    limit_cpu (CpuLevel::kAvx2);
    ASSERT_EQ (here.result.slices, there.result.slices) << i;
    ASSERT_EQ (here.result.bad_slices, there.result.bad_slices) << i;
    ASSERT_EQ (here.result.points, there.result.points) << i;
  }
}

TEST (PackedTables, every_context_has_a_complete_prefix_code)
{
  const auto kraft = [] (std::span<const std::uint8_t> lengths) {
    int sum = 0;
    for (std::uint8_t length : lengths)
      sum += length > 0 ? 1 << (16 - length) : 0;
    return sum;
  };
  for (const auto &lengths : kChoiceLengths)
    EXPECT_EQ (kraft (lengths), 1 << 16);
  for (const auto &lengths : kPatternLengths)
    EXPECT_EQ (kraft (lengths), 1 << 16);
}

/* All models of a slice, by kind. */
template <class Work>
void
for_all_models (const EntropyModel &all, const Work &work)
{
  for (const ChoiceModel &model : all.choices)
    work (model);
  for (const auto &of_number : all.residuals)
    for (const NumberModel &model : of_number)
      work (model);
  for (const NumberModel &model : all.runs)
    work (model);
  work (all.motion_change);
  for (const NumberModel &model : all.motions)
    work (model);
}

template <int kSymbols>
void
expect_frequencies (const SymbolModel<kSymbols> &model)
{
  EXPECT_EQ (model.starts[0], 0);
  EXPECT_EQ (model.starts[kSymbols], kFrequencySum);
  for (std::size_t symbol = 0; symbol < kSymbols; symbol++)
    EXPECT_GE (model.starts[symbol + 1], model.starts[symbol] + kMinFrequency);
}

TEST (EntropyModels, every_symbol_can_be_coded_at_the_beginning_and_after_any_others)
{
  std::mt19937 random (1);
  for (const auto &[key, step] : {std::pair{true, 1}, {true, 5}, {true, 7}, {false, 1}})
    for_all_models (
        initial_model (key, Components{step, step, step, step}), [&] (const auto &initial) {
          auto model = initial;
          expect_frequencies (model);
          for (int i = 0; i < 500; i++)
            model.learn (i < 400 ? 0 : random () % (std::size (model.starts) - 1));
          expect_frequencies (model);
          for (std::uint32_t number = 0; number < kFrequencySum; number += 61) {
            const std::size_t symbol = model.find (number);
            ASSERT_LE (model.starts[symbol], number);
            ASSERT_GT (model.starts[symbol + 1], number);
          }
        });
}

TEST (Rans, symbols_and_raw_bits_come_back_in_at_most_the_bytes_that_were_foretold)
{
  std::mt19937 random (2);
  for (int round = 0; round < 200; round++) {
    const unsigned skew = random () % 300, count = random () % 5000;
    const EntropyModel &initial = initial_model (true, Components{5, 5, 5, 5});
    ChoiceModel choices = initial.choices[0];
    NumberModel numbers = initial.runs[0];
    struct Symbol {
      unsigned state, kind, value;
    };
    std::vector<Symbol> symbols (count);
    std::vector<std::uint32_t> entries (count);
    RansEncoder encoder (entries.data ());
    for (Symbol &s : symbols) {
      s = {static_cast<unsigned> (random () % kRansStates), static_cast<unsigned> (random () % 3),
          0};
      const bool usual = random () % 300 < skew;
      s.value = usual ? 0 : static_cast<unsigned> (random ()) % (s.kind == 0 ? 7 : 15);
      if (s.kind == 0)
        encoder.code (s.state, choices, s.value);
      else if (s.kind == 1)
        encoder.code (s.state, numbers, s.value);
      else
        encoder.raw (s.state, s.value, 4);
    }
    std::vector<std::uint8_t> bytes (encoder.bound ());
    const std::size_t size = encoder.finish (bytes.data ());
    ASSERT_LE (size, encoder.bound ());
    EXPECT_LE (encoder.bound (), size + size / 16 + 16); /* it is not far off */
    choices = initial.choices[0];
    numbers = initial.runs[0];
    RansDecoder decoder (bytes.data (), size);
    for (const Symbol &s : symbols)
      ASSERT_EQ (s.kind == 0   ? decoder.code (s.state, choices)
                 : s.kind == 1 ? decoder.code (s.state, numbers)
                               : decoder.raw (s.state, 4),
          s.value);
    EXPECT_TRUE (decoder.at_clean_end ());
  }
}
