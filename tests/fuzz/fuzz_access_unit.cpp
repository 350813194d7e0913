/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as access units that follow one another, through one decoder: planned, and decoded into
 * images of exactly the planned size; by one thread with all that the CPU can do, and by three with
 * code for every CPU, which must come to the same. The first byte is a sum of Option; each access
 * unit is one byte that is a sum of How, two of size, units. */
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <rangecast/base/cpu.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>

using namespace rangecast;

using Bytes = std::span<const std::uint8_t>;

enum Option { kWholeRois = 2, kOnce = 4 };
/* Frame numbers of its slices are left, one more than before, the same, or others. */
enum How { kNumbers = 3, kOneMore = 1, kSame = 2, kOther = 3, kForget = 4 };

static Rig
two_views ()
{
  Rig rig;
  for (int id = 0; id < 2; id++) {
    View view;
    view.id = id;
    view.width = 64;
    view.height = 48;
    view.intrinsics = {60, 60, 31.5, 23.5};
    rig.views.push_back (view);
  }
  return rig;
}

static void
expect (bool fact)
{
  if (!fact)
    std::abort ();
}

/* Images of one frame set, each in memory of its own so that the sanitizer sees its end. */
struct Pictures {
  std::vector<std::unique_ptr<std::uint16_t[]>> depths;
  std::vector<std::unique_ptr<Rgbx[]>> colours;
  std::vector<RangeImage> images;

  void make (std::span<const AccessUnitDecoder::PlannedView> views)
  {
    depths.clear ();
    colours.clear ();
    images.clear ();
    for (const auto &view : views) {
      const int width = view.roi.width, height = view.roi.height;
      const auto pixels = std::size_t (width) * std::size_t (height);
      depths.emplace_back (new std::uint16_t[pixels]);
      colours.emplace_back (new Rgbx[pixels]);
      std::fill_n (depths.back ().get (), pixels, 0xabcd); /* all must be overwritten */
      std::fill_n (colours.back ().get (), pixels, Rgbx{});
      images.push_back ({view.view_id, view.roi, {depths.back ().get (), width, height, width * 2},
          {colours.back ().get (), width, height, width * 4}, 0});
    }
  }
  [[nodiscard]] std::uint64_t valid () const
  {
    std::uint64_t count = 0;
    for (const RangeImage &image : images)
      for (int i = 0; i < image.roi.width * image.roi.height; i++)
        count += image.depth.data[i] != kInvalidDepth;
    return count;
  }
};

static bool
same (const RangeImage &a, const RangeImage &b)
{
  bool equal = a.view_id == b.view_id && a.roi == b.roi;
  for (int i = 0; equal && i < a.roi.width * a.roi.height; i++)
    equal = a.depth.data[i] == b.depth.data[i] &&
            (a.depth.data[i] == kInvalidDepth ||
                std::memcmp (&a.colour.data[i], &b.colour.data[i], sizeof (Rgbx)) == 0);
  return equal;
}

static bool
same (const DecoderResult &a, const DecoderResult &b)
{
  return a.slices == b.slices && a.bad_slices == b.bad_slices &&
         a.missing_pixels == b.missing_pixels && a.points == b.points &&
         a.unknown_pixels == b.unknown_pixels && a.raw_bits == b.raw_bits;
}

/* A decoder, what it made of an access unit, and of the one before. */
struct Player {
  CpuLevel cpu;
  int threads;
  AccessUnitDecoder decoder;
  DecoderResult result;
  Pictures pictures, last;

  void decode (Bytes access_unit, int options)
  {
    result = {};
    decoder.plan (access_unit, result, options & kWholeRois);
    std::swap (pictures, last);
    pictures.make (decoder.views ());
    limit_cpu (cpu);
    expect (decoder.decode (pictures.images, threads, result).ok ());
    limit_cpu (CpuLevel::kAvx2);
    check ();
  }

  void check () const
  {
    std::uint64_t coded = 0, slices = 0, foretold = 0;
    for (std::size_t i = 0; i < decoder.views ().size (); i++) {
      const auto &view = decoder.views ()[i];
      expect (i == 0 || view.view_id > decoder.views ()[i - 1].view_id);
      coded += view.coded_pixels;
      slices += view.slice_count;
      foretold += decoder.missing_pixels (i);
    }
    expect (result.missing_pixels <= coded && result.points <= coded && result.slices <= slices);
    expect (result.points == pictures.valid ());
    expect (result.points == 0 || result.slices > 0);
    expect (foretold > 0 || result.missing_pixels == 0);
    expect (result.points + result.missing_pixels <= coded);
  }
};

static Player *
make_player (CpuLevel cpu, int threads)
{
  auto made = new Player{cpu, threads, {}, {}, {}, {}};
  expect (made->decoder.set_rig (two_views ()).ok ());
  return made;
}

/* Gives slices of the access unit a frame number; others stay as they are. */
static void
set_number (std::vector<std::uint8_t> &access_unit, std::uint32_t number)
{
  for (std::size_t at = 0; at + kSliceHeaderSize <= access_unit.size ();) {
    const std::size_t size = access_unit[at + 2] | access_unit[at + 3] << 8;
    if ((access_unit[at] & 15) == static_cast<int> (UnitType::kSlice))
      for (std::size_t i = 0; i < 4; i++)
        access_unit[at + 8 + i] = static_cast<std::uint8_t> (number >> 8 * i);
    at += std::max (size, kUnitHeaderSize);
  }
}

static std::uint32_t
next_number (std::uint32_t number, int how)
{
  switch (how & kNumbers) {
    case kOneMore:
      return number + 1;
    case kOther:
      return number * 2654435761u + static_cast<std::uint32_t> (how >> 3);
    default:
      return number;
  }
}

static void
collect_rig (Bytes access_unit)
{
  RigCollector collector;
  UnitReader units (access_unit);
  UnitHeader header;
  while (const auto unit = units.next (header))
    (void)collector.add (*unit).ok ();
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static Player &player = *make_player (CpuLevel::kAvx2, 1),
                &other = *make_player (CpuLevel::kScalar, 3);
  if (size == 0)
    return 0;
  const int options = data[0];
  std::uint32_t number = 0;
  for (Player *p : {&player, &other}) {
    p->decoder.reset_references ();
    p->pictures.make ({});
  }
  for (Bytes rest (data + 1, size - 1); rest.size () >= 3;) {
    const int how = rest[0];
    const auto length = std::min<std::size_t> (rest[1] | rest[2] << 8, rest.size () - 3);
    const auto part = rest.subspan (3, length);
    std::vector<std::uint8_t> access_unit (part.begin (), part.end ());
    number = next_number (number, how);
    if (how & kNumbers)
      set_number (access_unit, number);
    for (Player *p : {&player, &other}) {
      if (how & kForget)
        p->decoder.reset_references ();
      if (p == &player || !(options & kOnce))
        p->decode (access_unit, options);
    }
    if (!(options & kOnce)) {
      expect (same (player.result, other.result));
      expect (std::ranges::equal (player.pictures.images, other.pictures.images,
          [] (const RangeImage &a, const RangeImage &b) { return same (a, b); }));
    }
    collect_rig (access_unit);
    rest = rest.subspan (3 + length);
  }
  return 0;
}
