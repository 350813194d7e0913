/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Access units in byte streams, sound, damaged and hostile; and in files, by time. */
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

using namespace rangecast;

namespace {

constexpr std::uint64_t kFrame_ns = 40'000'000;

void
append_unit (std::vector<std::uint8_t> &to, std::uint8_t type, std::size_t size)
{
  const std::size_t begin = to.size ();
  to.resize (begin + size, 0xab);
  to[begin] = std::uint8_t (kBitstreamVersion << 4 | type);
  to[begin + 1] = 0;
  to[begin + 2] = std::uint8_t (size & 255);
  to[begin + 3] = std::uint8_t (size >> 8);
}

/* An access unit of a rig view, if wanted, and two slices of which only the sizes are sound. */
std::vector<std::uint8_t>
make_access_unit (std::uint64_t pts_ns, bool key = true, bool rig = false, std::size_t size = 300)
{
  std::vector<std::uint8_t> units;
  if (rig)
    append_unit (units, 2, 60);
  append_unit (units, 1, size);
  append_unit (units, 1, size);
  std::vector<std::uint8_t> bytes (kAccessUnitHeaderSize);
  write_access_unit_header ({std::uint32_t (units.size ()), pts_ns, 0, key}, bytes.data ());
  bytes.insert (bytes.end (), units.begin (), units.end ());
  return bytes;
}

void
append (std::vector<std::uint8_t> &to, const std::vector<std::uint8_t> &bytes)
{
  to.insert (to.end (), bytes.begin (), bytes.end ());
}

/* A file of 25 access units a second, a rig and a key one each second, in memory. */
struct File {
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint64_t> offsets;
  std::size_t bytes_read = 0;

  explicit File (int frames, std::uint64_t first_pts_ns = 7'000'000'000)
  {
    for (int i = 0; i < frames; i++) {
      offsets.push_back (bytes.size ());
      const bool second = i % 25 == 0;
      append (bytes,
          make_access_unit (first_pts_ns + i * kFrame_ns, second, second, 300 + i * 37 % 900));
    }
  }
  StreamFile open ()
  {
    return {[this] (std::uint64_t offset, std::size_t size, std::vector<std::uint8_t> &to) {
              const std::size_t begin = std::min<std::uint64_t> (offset, bytes.size ());
              const std::size_t end = std::min (begin + size, bytes.size ());
              to.assign (
                  bytes.begin () + std::ptrdiff_t (begin), bytes.begin () + std::ptrdiff_t (end));
              bytes_read += to.size ();
            },
        bytes.size ()};
  }
};

} // namespace

TEST (ByteStream, WholeAccessUnitNeedsNoByteOfTheNext)
{
  const auto bytes = make_access_unit (5);
  const StreamPart part = next_part (bytes, false);
  EXPECT_EQ (part.length, bytes.size ());
  EXPECT_EQ (part.header.pts_ns, 5u);
}

TEST (ByteStream, PartOfAnAccessUnitAsksForMoreButNeverForMoreThanItSays)
{
  const auto bytes = make_access_unit (5);
  for (std::size_t size = 0; size < bytes.size (); size++) {
    const std::vector<std::uint8_t> cut (bytes.begin (), bytes.begin () + std::ptrdiff_t (size));
    const StreamPart part = next_part (cut, false);
    EXPECT_GT (part.wanted, size);
    EXPECT_LE (part.wanted, bytes.size ());
  }
}

TEST (ByteStream, SizeThatLiesEndsAtTheNextAccessUnit)
{
  const auto sound = make_access_unit (5);
  for (std::uint32_t lie : {30u, 100000u, 32u << 20}) {
    auto bytes = sound;
    write_access_unit_header ({lie, 5, 0, true}, bytes.data ());
    append (bytes, sound);
    const StreamPart part = next_part (bytes, false);
    EXPECT_EQ (part.length, lie < sound.size () ? kAccessUnitHeaderSize : sound.size ());
  }
}

TEST (ByteStream, LostBytesEndAtTheNextAccessUnit)
{
  auto bytes = make_access_unit (5);
  const std::size_t size = bytes.size () - 50;
  bytes.resize (size);
  append (bytes, make_access_unit (6));
  append (bytes, make_access_unit (7));
  EXPECT_EQ (next_part (bytes, false).length, size);
}

TEST (ByteStream, TruncatedEndHasTheSizeThatItShouldHave)
{
  const auto whole = make_access_unit (5);
  for (std::size_t size = 1; size <= whole.size (); size++) {
    const std::vector<std::uint8_t> cut (whole.begin (), whole.begin () + std::ptrdiff_t (size));
    const std::size_t expected = size < 8                       ? 0
                                 : size < kAccessUnitHeaderSize ? kAccessUnitHeaderSize
                                 : size < whole.size ()         ? whole.size ()
                                                                : 0;
    EXPECT_EQ (next_part (cut, true).expected, expected) << size;
    EXPECT_EQ (next_part (cut, false).expected, 0u) << size;
  }
}

TEST (ByteStream, AnyBytesAreUsedUpOrAskForMore)
{
  std::mt19937 random (1);
  const auto sound = make_access_unit (5, true, true);
  for (int run = 0; run < 20000; run++) {
    std::vector<std::uint8_t> bytes = sound;
    append (bytes, sound);
    for (int i = random () % 6; i > 0; i--)
      bytes[random () % bytes.size ()] = std::uint8_t (random ());
    const std::size_t begin = random () % 40 * (run % 2);
    /* exactly its size, so that one byte too far is seen */
    const std::vector<std::uint8_t> cut (bytes.begin () + std::ptrdiff_t (begin),
        bytes.end () - std::ptrdiff_t (random () % sound.size ()));
    for (const bool at_end : {false, true}) {
      const StreamPart part = next_part (cut, at_end);
      EXPECT_EQ ((part.garbage > 0) + (part.length > 0) + (part.wanted > 0), 1);
      EXPECT_LE (part.garbage, cut.size ());
      EXPECT_LE (part.length, cut.size ());
      EXPECT_TRUE (part.wanted == 0 || (part.wanted > cut.size () && !at_end));
    }
  }
}

TEST (StreamFile, EveryTimeFindsItsKeyAccessUnits)
{
  File file (500);
  StreamFile opened = file.open ();
  for (std::size_t i = 0; i < 500; i += 7) {
    const auto target = opened.locate (7'000'000'000 + i * kFrame_ns + 1);
    ASSERT_TRUE (target.before);
    EXPECT_EQ (target.before->offset, file.offsets[i / 25 * 25]);
    ASSERT_EQ (target.after.has_value (), i < 475);
    if (target.after) {
      EXPECT_EQ (target.after->offset, file.offsets[i / 25 * 25 + 25]);
    }
  }
}

TEST (StreamFile, TimeBeforeTheFirstFindsTheFirst)
{
  File file (100);
  const auto target = file.open ().locate (1);
  EXPECT_FALSE (target.before);
  ASSERT_TRUE (target.after);
  EXPECT_EQ (target.after->offset, 0u);
}

TEST (StreamFile, LongFileIsNotReadAsAWhole)
{
  File file (20000);
  const auto target = file.open ().locate (7'000'000'000 + 12345 * kFrame_ns);
  ASSERT_TRUE (target.before);
  EXPECT_EQ (target.before->offset, file.offsets[12325]);
  EXPECT_LT (file.bytes_read, file.bytes.size () / 10);
}

TEST (StreamFile, LastAccessUnitIsFoundBehindRubbish)
{
  File file (50);
  file.bytes.resize (file.bytes.size () + 200000, 0x52);
  const auto last = file.open ().last ();
  ASSERT_TRUE (last);
  EXPECT_EQ (last->offset, file.offsets[49]);
}

TEST (StreamFile, StreamsWithoutTimesOrAccessUnitsFindNothing)
{
  File empty (0), untimed (0);
  for (int i = 0; i < 2000; i++)
    append (untimed.bytes, make_access_unit (kNoTime));
  EXPECT_FALSE (empty.open ().last ());
  EXPECT_FALSE (empty.open ().locate (5).before);
  const auto target = untimed.open ().locate (5'000'000'000);
  EXPECT_FALSE (target.before || target.after);
  File garbage (0);
  garbage.bytes.assign (1000000, 0);
  EXPECT_FALSE (garbage.open ().last ());
  EXPECT_FALSE (garbage.open ().locate (5).before);
}

TEST (StreamFile, AnyDamageEnds)
{
  std::mt19937 random (2);
  for (int run = 0; run < 50; run++) {
    File file (600);
    for (int i = 0; i < 3000; i++)
      file.bytes[random () % file.bytes.size ()] ^= std::uint8_t (1 << random () % 8);
    StreamFile opened = file.open ();
    (void)opened.last ();
    (void)opened.locate (random () * 10ull);
    (void)opened.locate (UINT64_MAX - 1);
  }
}

/* Files one after another. */
static File
join (const std::vector<File> &files)
{
  File joined (0);
  for (const File &file : files) {
    for (const std::uint64_t offset : file.offsets)
      joined.offsets.push_back (joined.bytes.size () + offset);
    append (joined.bytes, file.bytes);
  }
  return joined;
}

/* The times of all access units, one after another. */
static std::vector<std::uint64_t>
times_of (File &file)
{
  StreamTimes stream;
  std::vector<std::uint64_t> times;
  for (const std::uint64_t offset : file.offsets) {
    AccessUnitPlace unit{offset, {}, file.bytes[offset + kAccessUnitHeaderSize] % 16 == 2};
    EXPECT_TRUE (begins_access_unit (std::span (file.bytes).subspan (offset), unit.header));
    times.push_back (stream.next (unit, kFrame_ns).time_ns);
  }
  return times;
}

TEST (StreamTimes, JoinedFilesFollowEachOther)
{
  File file = join ({File (30), File (1), File (1, 0), File (40, 0), File (50, 8'000'000'000)});
  const auto times = times_of (file);
  for (std::size_t i = 0; i < 72; i++)
    EXPECT_EQ (times[i], i * kFrame_ns);
  EXPECT_EQ (times[72], 32 * kFrame_ns + 8'000'000'000); /* later: as in one file */
}

TEST (StreamTimes, DamagedTimeWithoutRigChangesNoOther)
{
  const File first (8), second (6, 0);
  File sound = join ({first, second});
  const auto times = times_of (sound);
  EXPECT_EQ (times.back (), 13 * kFrame_ns);
  for (const std::size_t unit : {1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 13})
    for (int bit = 0; bit < 64; bit++) {
      File damaged = sound;
      damaged.bytes[damaged.offsets[unit] + 12 + std::size_t (bit / 8)] ^=
          std::uint8_t (1 << bit % 8);
      const auto now = times_of (damaged);
      const bool meet = unit == 7; /* the next file follows its time */
      for (std::size_t i = meet ? unit + 3 : 0; i < 14; i++)
        if (i != unit) {
          EXPECT_EQ (now[i] - (meet ? now[i - 1] : 0), meet ? kFrame_ns : times[i])
              << "bit " << bit << " of " << unit << " changes " << i;
        }
    }
}

TEST (StreamTimes, WhatWasSoughtCountsFromTheFirst)
{
  StreamTimes stream;
  const auto time_of = [&stream] (std::uint64_t pts, bool rig) {
    const auto time = stream.next ({0, {600, pts, 0, true}, rig}, kFrame_ns);
    EXPECT_FALSE (time.goes_back);
    return time.time_ns;
  };
  EXPECT_EQ (time_of (5 * kFrame_ns, true), 0u);
  for (const std::uint64_t frame : {70, 9, 10, 5}) {
    stream.seek ();
    EXPECT_EQ (time_of (frame * kFrame_ns, true), (frame - 5) * kFrame_ns);
    EXPECT_EQ (time_of ((frame + 1) * kFrame_ns, false), (frame - 4) * kFrame_ns);
  }
}

TEST (StreamTimes, ShortFilesFollowEachOtherInAnyOrder)
{
  for (int order = 0; order < 256; order++) { /* four of 1 to 4 access units */
    std::vector<File> files;
    for (int i = 0; i < 4; i++)
      files.emplace_back (1 + (order >> 2 * i) % 4, 0);
    File file = join (files);
    const auto times = times_of (file);
    for (std::size_t i = 0; i < times.size (); i++)
      EXPECT_EQ (times[i], i * kFrame_ns) << order;
  }
}

TEST (StreamTimes, NextStreamBeginsAFrameAfterTheLast)
{
  StreamTimes stream;
  std::uint64_t frame = 0;
  for (const std::uint64_t first : {0, 1, 2}) {
    stream.begin_stream ();
    for (std::uint64_t i = 0; i < 5; i++) {
      const auto time = stream.next ({i, {600, first + i * kFrame_ns, 0, true}, i == 0}, kFrame_ns);
      EXPECT_EQ (time.time_ns, frame++ * kFrame_ns);
    }
  }
}
