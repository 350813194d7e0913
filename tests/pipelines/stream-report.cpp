/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is missing in a recorded stream of coded frame sets, told from what stands in its slices, so
 * that nothing depends on when they came. */
#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <string>
#include <vector>

using namespace rangecast;

namespace {

struct ViewFrame {
  std::uint32_t number = 0;
  std::int64_t capture_ms = 0;
  std::int64_t covered = 0, pixels = 0; /* of its ROI */
};

struct ViewReport {
  std::uint64_t frames = 0, missing = 0, damaged = 0, restarts = 0;
  std::int64_t first_ms = 0, last_ms = 0, gap_ms = 0;
  std::uint32_t number = 0, began = 0; /* the last one; the first one since the last restart */
};

using FrameSet = std::map<int, ViewFrame>;

FrameSet
read_frame_set (std::span<const std::uint8_t> units)
{
  FrameSet frame_set;
  UnitReader reader (units);
  UnitHeader header;
  SliceHeader slice;
  while (const auto unit = reader.next (header)) {
    if (header.type != std::uint8_t (UnitType::kSlice) || !read_slice_header (*unit, slice).ok ())
      continue;
    ViewFrame &view = frame_set[slice.view_id];
    view.number = slice.frame_number;
    view.capture_ms = std::int64_t (slice.capture_time_ns / 1000000);
    view.covered += std::int64_t (slice.rows) * slice.columns;
    view.pixels = std::int64_t (slice.roi.width) * slice.roi.height;
  }
  return frame_set;
}

void
add (std::map<int, ViewReport> &reports, const FrameSet &frame_set)
{
  for (const auto &[id, view] : frame_set) {
    ViewReport &report = reports[id];
    if (report.frames == 0) {
      report.first_ms = view.capture_ms;
      report.began = view.number;
    } else {
      report.gap_ms = std::max (report.gap_ms, view.capture_ms - report.last_ms);
      if (view.number > report.number)
        report.missing += view.number - report.number - 1;
      else {
        report.restarts++; /* an encoder counts from 0 */
        report.began = view.number;
      }
    }
    report.frames++;
    report.damaged += view.covered != view.pixels;
    report.number = view.number;
    report.last_ms = view.capture_ms;
  }
}

std::int64_t
oldest_ms (const FrameSet &frame_set)
{
  std::int64_t oldest = INT64_MAX;
  for (const auto &[id, view] : frame_set)
    oldest = std::min (oldest, view.capture_ms);
  return oldest;
}

/* One line a frame set: capture time of its oldest view, and a letter a view: its number if it is
 * whole, ! if slices are missing. */
void
print_frame_set (const FrameSet &frame_set)
{
  std::string views;
  for (const auto &[id, view] : frame_set)
    views += view.covered == view.pixels ? std::to_string (id) + " " : "! ";
  std::printf ("%" PRId64 " %s\n", oldest_ms (frame_set), views.c_str ());
}

/* One line a view of each frame set: capture time of that, view, which of its encoder's frames. */
void
print_numbers (const FrameSet &frame_set)
{
  for (const auto &[id, view] : frame_set)
    std::printf ("%" PRId64 " %d %" PRIu32 "\n", oldest_ms (frame_set), id, view.number);
}

} // namespace

int
main (int argc, char **argv)
{
  const bool list = argc == 3 && std::strcmp (argv[1], "--list") == 0;
  const bool numbers = argc == 3 && std::strcmp (argv[1], "--numbers") == 0;
  if (argc != 2 && !list && !numbers) {
    std::fprintf (stderr,
        "usage: stream-report [--list | --numbers] FILE.rcnc\n"
        "For each view: frames, those missing between the first and the last by their numbers,\n"
        "those that lack slices, how often its encoder began again and which of its frames was "
        "the\n"
        "first to come since, and the longest time from one capture time to the next. --list: "
        "capture time (ms) and views of each frame set. --numbers: capture time (ms) of each frame "
        "set, a view of it, and which of its encoder's frames that is.\n");
    return 2;
  }
  std::ifstream file (argv[argc - 1], std::ios::binary);
  const std::vector<char> content{std::istreambuf_iterator<char> (file), {}};
  std::span<const std::uint8_t> rest (
      reinterpret_cast<const std::uint8_t *> (content.data ()), content.size ());
  std::map<int, ViewReport> reports;
  while (!rest.empty ()) {
    const StreamPart part = next_part (rest, true);
    if (part.length > kAccessUnitHeaderSize) {
      const FrameSet frame_set = read_frame_set (
          rest.subspan (kAccessUnitHeaderSize, part.length - kAccessUnitHeaderSize));
      add (reports, frame_set);
      if (list && !frame_set.empty ())
        print_frame_set (frame_set);
      if (numbers && !frame_set.empty ())
        print_numbers (frame_set);
    }
    const std::size_t used = std::max (part.garbage, part.length);
    if (used == 0)
      break;
    rest = rest.subspan (used);
  }
  if (!list && !numbers)
    for (const auto &[id, r] : reports)
      std::printf ("view %d frames %" PRIu64 " missing %" PRIu64 " damaged %" PRIu64
                   " restarts %" PRIu64 " began %" PRIu32 " gap %" PRId64 " ms of %" PRId64 " ms\n",
          id, r.frames, r.missing, r.damaged, r.restarts, r.began, r.gap_ms,
          r.last_ms - r.first_ms);
  return 0;
}
