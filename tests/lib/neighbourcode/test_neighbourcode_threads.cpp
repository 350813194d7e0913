/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pieces and slices in parallel: nothing that comes out may depend on the number of threads. And
 * one thread needs no new memory once it has seen a few frame sets. */
#include "neighbourcode-support.hpp"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>
#include <random>

static std::atomic<long> allocations{0};

/* The compiler does not see that these belong together. */
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"

void *
operator new (std::size_t size)
{
  allocations++;
  if (void *memory = std::malloc (size > 0 ? size : 1))
    return memory;
  throw std::bad_alloc ();
}

void
operator delete (void *memory) noexcept
{
  std::free (memory);
}

void
operator delete (void *memory, std::size_t) noexcept
{
  std::free (memory);
}

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr int kFrameSets = 5, kViews = 2;

/* A person who moves by some pixels and whose ROI grows and shrinks. */
Picture
moving_picture (int view, int frame)
{
  const int wider = 5 * (2 - frame % 3); /* the widest comes first, and to both references */
  return {view, {30 + 3 * frame, 20 + 2 * frame, 150 + wider, 110 + wider},
      unsigned (10 * view + frame), 1};
}

/* Stands still, so that slices with a reference become wide; then there is nothing but noise. */
Picture
picture_that_becomes_noise (int view, int frame)
{
  const bool is_noise = frame >= 3;
  return {view, {30, 20, 150, 110}, unsigned (is_noise ? frame : 1), is_noise ? 60.0 : 1.0};
}

using PictureOf = Picture (*) (int view, int frame);

std::vector<Picture>
frame_set (int frame, PictureOf picture_of = moving_picture)
{
  std::vector<Picture> pictures;
  for (int view = 0; view < kViews; view++)
    pictures.push_back (picture_of (view, frame));
  return pictures;
}

std::vector<RangeImage>
images_of (std::vector<Picture> &pictures, std::uint64_t time_ns)
{
  std::vector<RangeImage> images;
  for (Picture &picture : pictures) {
    images.push_back (picture.image ());
    images.back ().capture_time_ns = time_ns;
  }
  return images;
}

std::uint64_t
time_of (int frame)
{
  return 1'000'000'000 + std::uint64_t (frame) * 300'000'000; /* bands are refreshed in between */
}

struct CodedSet {
  std::vector<std::uint8_t> bytes;
  EncoderResult result;
};

/* A scene, frame set after frame set. */
std::vector<CodedSet>
encode_all (const EncoderSettings &settings, int threads, PictureOf picture_of = moving_picture)
{
  AccessUnitEncoder encoder;
  EXPECT_TRUE (encoder.configure (ring_rig (kViews), settings).ok ());
  std::vector<CodedSet> coded;
  for (int frame = 0; frame < kFrameSets; frame++) {
    auto pictures = frame_set (frame, picture_of);
    CodedSet &set = coded.emplace_back ();
    EXPECT_TRUE (encoder
                     .encode (images_of (pictures, time_of (frame)), std::uint32_t (frame), threads,
                         set.result)
                     .ok ());
    set.bytes = encoder.bytes ();
    EXPECT_EQ (set.bytes.size (), encoder.size ());
  }
  return coded;
}

std::vector<EncoderSettings>
all_settings ()
{
  std::vector<EncoderSettings> all;
  for (const Profile profile : {Profile::kPlain, Profile::kPacked, Profile::kEntropy})
    for (const bool temporal : {false, true})
      for (const NeighbourChoice choice : {NeighbourChoice::kFirst, NeighbourChoice::kBest}) {
        if (profile == Profile::kPlain && (temporal || choice == NeighbourChoice::kBest))
          continue;
        EncoderSettings settings;
        settings.profile = profile;
        settings.temporal = temporal;
        settings.choice = choice;
        settings.max_slice_size = 400; /* several pieces in a small picture */
        all.push_back (settings);
      }
  return all;
}

void
expect_same_for_all_threads (const EncoderSettings &settings, PictureOf picture_of = moving_picture)
{
  const auto expected = encode_all (settings, 1, picture_of);
  for (const int threads : {2, 3, 8}) {
    const auto coded = encode_all (settings, threads, picture_of);
    for (std::size_t frame = 0; frame < expected.size (); frame++) {
      const EncoderResult &a = expected[frame].result, &b = coded[frame].result;
      EXPECT_EQ (coded[frame].bytes, expected[frame].bytes)
          << "profile " << int (settings.profile) << ", temporal " << settings.temporal
          << ", threads " << threads << ", frame set " << frame;
      EXPECT_EQ (a.points, b.points);
      EXPECT_EQ (a.full_pixels, b.full_pixels);
      EXPECT_EQ (a.slices, b.slices);
      EXPECT_EQ (a.delta_slices, b.delta_slices);
      EXPECT_EQ (a.raw_bits, b.raw_bits);
    }
  }
}

TEST (Threads, encoder_gives_the_same_bytes_with_any_number)
{
  for (const EncoderSettings &settings : all_settings ())
    expect_same_for_all_threads (settings);
}

/* Pieces are cut again where a row alone is longer than a slice. */
TEST (Threads, encoder_gives_the_same_bytes_where_pieces_were_too_wide)
{
  for (EncoderSettings settings : all_settings ()) {
    settings.max_slice_size = 256;
    settings.depth_bits = 16;
    settings.depth_threshold = settings.colour_threshold = 1;
    expect_same_for_all_threads (settings, picture_that_becomes_noise);
    if (settings.profile != Profile::kPacked || settings.temporal)
      continue;
    /* The first estimate depends on the ROI alone, and the first picture fits it. */
    SliceHeader smooth, noise;
    const auto sets = encode_all (settings, 1, picture_that_becomes_noise);
    ASSERT_TRUE (read_slice_header (units_of (sets[0].bytes)[0], smooth).ok ());
    ASSERT_TRUE (read_slice_header (units_of (sets[3].bytes)[0], noise).ok ());
    ASSERT_EQ (smooth.roi, noise.roi);
    EXPECT_LT (noise.columns, smooth.columns); /* or this shows nothing */
  }
}

TEST (Threads, a_moving_scene_has_slices_with_and_without_reference)
{
  EncoderSettings settings;
  settings.profile = Profile::kEntropy;
  settings.temporal = true;
  std::uint64_t slices = 0, delta_slices = 0;
  for (const CodedSet &set : encode_all (settings, 2)) {
    slices += set.result.slices;
    delta_slices += set.result.delta_slices;
  }
  EXPECT_GT (delta_slices, 0u);
  EXPECT_LT (delta_slices, slices);
}

/* ---- decoder ---- */

/* A decoder and what it showed last. */
struct Receiver {
  AccessUnitDecoder decoder;
  std::vector<Picture> shown;
  DecoderResult result;

  Receiver () { EXPECT_TRUE (decoder.set_rig (ring_rig (kViews)).ok ()); }
  void receive (std::span<const std::uint8_t> bytes, int threads, bool whole_rois)
  {
    result = {};
    decoder.plan (bytes, result, whole_rois);
    std::vector<Picture> pictures;
    for (const auto &view : decoder.views ())
      pictures.push_back (Picture::blank (view.view_id, view.roi, 0x5a5a));
    EXPECT_TRUE (decoder.decode (images_of (pictures, 0), threads, result).ok ());
    shown = std::move (pictures);
  }
};

void
expect_same (Receiver &a, Receiver &b)
{
  EXPECT_EQ (a.result.slices, b.result.slices);
  EXPECT_EQ (a.result.bad_slices, b.result.bad_slices);
  EXPECT_EQ (a.result.missing_pixels, b.result.missing_pixels);
  EXPECT_EQ (a.result.points, b.result.points);
  EXPECT_EQ (a.result.unknown_pixels, b.result.unknown_pixels);
  EXPECT_EQ (a.result.raw_bits, b.result.raw_bits);
  ASSERT_EQ (a.shown.size (), b.shown.size ());
  for (std::size_t i = 0; i < a.shown.size (); i++) {
    const RangeImage one = a.shown[i].image (), other = b.shown[i].image ();
    ASSERT_EQ (one.roi, other.roi);
    for (int y = 0; y < one.roi.height; y++)
      for (int x = 0; x < one.roi.width; x++) {
        ASSERT_EQ (one.depth.at (x, y), other.depth.at (x, y)) << x << ", " << y;
        if (one.depth.at (x, y) != kInvalidDepth) {
          ASSERT_EQ (std::memcmp (&one.colour.at (x, y), &other.colour.at (x, y), 3), 0);
        }
      }
  }
}

using Units = std::vector<std::vector<std::uint8_t>>;

/* What may happen to the slices of a frame set: as `kind` says. @param others  of the same frame
 * set, cut into other pieces */
void
spoil (Units &units, const Units &others, int kind, std::mt19937 &random)
{
  const auto any = [&] (std::size_t n) { return random () % n; };
  if (kind & 1) /* bits are damaged, in the header as often as behind it */
    for (auto &unit : units)
      if (any (4) == 0) {
        const bool in_header = any (2) == 0;
        const std::size_t begin = in_header ? kUnitHeaderSize : kSliceHeaderSize;
        const std::size_t end = in_header ? kSliceHeaderSize : unit.size ();
        unit[begin + any (end - begin)] ^= 1 << any (8);
      }
  if (kind & 2) /* lost */
    std::erase_if (units, [&] (const auto &) { return any (5) == 0; });
  if (kind & 4) { /* come twice, whole or damaged */
    const Units once = units;
    for (auto unit : once)
      if (any (3) == 0) {
        unit.back () ^= any (2);
        units.push_back (unit);
      }
  }
  if (kind & 8) /* overlap */
    for (const auto &unit : others)
      if (any (3) == 0)
        units.push_back (unit);
  std::ranges::shuffle (units, random);
}

/* @param narrow  the same frame sets, cut into other pieces */
void
expect_same_decoding (
    const std::vector<CodedSet> &sets, const std::vector<CodedSet> &narrow, int kind)
{
  std::mt19937 random (static_cast<unsigned> (kind));
  Receiver one, four;
  for (std::size_t frame = 0; frame < sets.size (); frame++) {
    Units units = units_of (sets[frame].bytes);
    spoil (units, units_of (narrow[frame].bytes), kind, random);
    const auto bytes = joined (units);
    one.receive (bytes, 1, kind & 1);
    four.receive (bytes, 4, kind & 1);
    expect_same (one, four);
    if (::testing::Test::HasFailure ())
      FAIL () << "kind " << kind << ", frame set " << frame;
  }
}

TEST (Threads, decoder_gives_the_same_whatever_becomes_of_slices)
{
  for (const EncoderSettings &settings : all_settings ()) {
    if (settings.choice == NeighbourChoice::kBest)
      continue;
    EncoderSettings narrow = settings;
    narrow.max_slice_size = 256;
    const auto sets = encode_all (settings, 1), narrow_sets = encode_all (narrow, 1);
    for (int kind = 0; kind < 16; kind++) {
      SCOPED_TRACE ("profile " + std::to_string (int (settings.profile)) + ", temporal " +
                    std::to_string (settings.temporal));
      expect_same_decoding (sets, narrow_sets, kind);
    }
  }
}

/* ---- memory ---- */

TEST (Threads, one_thread_allocates_nothing_from_frame_set_to_frame_set)
{
  constexpr int kWarm = 5, kCounted = 20;
  std::vector<std::vector<Picture>> sets;
  for (int frame = 0; frame < kFrameSets; frame++)
    sets.push_back (frame_set (frame));
  for (const EncoderSettings &settings : all_settings ()) {
    AccessUnitEncoder encoder;
    AccessUnitDecoder decoder;
    ASSERT_TRUE (encoder.configure (ring_rig (kViews), settings).ok ());
    ASSERT_TRUE (decoder.set_rig (ring_rig (kViews)).ok ());
    long of_encoder = 0, of_decoder = 0;
    for (int frame = 0; frame < kWarm + kCounted; frame++) {
      auto &pictures = sets[std::size_t (frame) % sets.size ()];
      const auto images = images_of (pictures, time_of (frame));
      auto shown = pictures;
      const auto shown_images = images_of (shown, 0);
      EncoderResult result;
      DecoderResult decoded;
      std::vector<std::uint8_t> bytes (200'000);
      std::size_t size = 0;
      const long before = allocations;
      const bool good = encoder.encode (images, std::uint32_t (frame), 1, result).ok ();
      for (const auto part : encoder.parts ()) {
        std::ranges::copy (part, bytes.begin () + std::ptrdiff_t (size));
        size += part.size ();
      }
      const long between = allocations;
      decoder.plan (std::span (bytes).first (size), decoded);
      const bool decodes = decoder.decode (shown_images, 1, decoded).ok ();
      if (frame >= kWarm) {
        of_encoder += between - before;
        of_decoder += allocations - between;
      }
      ASSERT_TRUE (good && decodes);
      ASSERT_EQ (decoded.bad_slices, 0u);
    }
    const std::string what = "profile " + std::to_string (int (settings.profile)) + ", temporal " +
                             std::to_string (settings.temporal) + ", choice " +
                             std::to_string (int (settings.choice));
    EXPECT_EQ (of_encoder, 0) << what;
    EXPECT_EQ (of_decoder, 0) << what;
  }
}

} // namespace
