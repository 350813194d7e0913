/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The background model and what is separated by it. */
#include "../test-support.hpp"

#include <fstream>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/roi/background.hpp>
#include <rangecast/roi/segmentation.hpp>
#include <rangecast/roi/surroundings.hpp>
#include <unistd.h>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

constexpr int kWidth = 64, kHeight = 48;

/* A grey wall 2 m away (20000 units) with noise, and whatever a test puts before it. */
struct Frame {
  Image<std::uint16_t> depth{kWidth, kHeight};
  Image<Rgbx> colour{kWidth, kHeight};

  explicit Frame (unsigned seed, double brightness = 1)
  {
    std::mt19937 random (seed);
    std::normal_distribution<double> grey (0, 2), range (0, 40);
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        depth.view ().at (x, y) = static_cast<std::uint16_t> (20000 + range (random));
        const auto level = [&] (double base) {
          return static_cast<std::uint8_t> (base * brightness + grey (random));
        };
        colour.view ().at (x, y) = {level (120), level (125), level (110), 0};
      }
  }
  void put (int x0, int y0, int width, int height, std::uint16_t z, Rgbx c)
  {
    for (int y = y0; y < y0 + height; y++)
      for (int x = x0; x < x0 + width; x++) {
        depth.view ().at (x, y) = z;
        colour.view ().at (x, y) = c;
      }
  }
  RangeImage image () { return {0, {0, 0, kWidth, kHeight}, depth.view (), colour.view (), 0}; }
  int valid (int x0, int y0, int width, int height)
  {
    int n = 0;
    for (int y = y0; y < y0 + height; y++)
      for (int x = x0; x < x0 + width; x++)
        n += depth.view ().at (x, y) != kInvalidDepth;
    return n;
  }
  int valid () { return valid (0, 0, kWidth, kHeight); }
};

BackgroundModel
learnt_wall ()
{
  BackgroundModel model;
  model.reset (kWidth, kHeight);
  for (unsigned i = 0; i < 20; i++)
    EXPECT_TRUE (model.learn (Frame (i).image ()).ok ());
  model.finish ();
  return model;
}

void
segment (Frame &frame, const SegmentationSettings &settings = {})
{
  Segmenter segmenter;
  ASSERT_TRUE (segmenter.clear_background (frame.image (), learnt_wall (), 1e-4, settings).ok ());
}

} // namespace

TEST (Background, mean_and_spread_are_those_of_the_samples)
{
  BackgroundModel model;
  model.reset (1, 1);
  Image<std::uint16_t> depth (1, 1);
  Image<Rgbx> colour (1, 1);
  const std::uint16_t depths[] = {1000, 0, 1004, 1002};
  for (int i = 0; i < 4; i++) {
    depth.view ().at (0, 0) = depths[i];
    const auto c = static_cast<std::uint8_t> (100 + 2 * i);
    colour.view ().at (0, 0) = {c, c, c, 0};
    ASSERT_TRUE (model.learn ({0, {0, 0, 1, 1}, depth.view (), colour.view (), 0}).ok ());
  }
  model.finish ();
  const BackgroundPixel &pixel = model.row (0)[0];
  EXPECT_FLOAT_EQ (pixel.mean[0], 103);
  EXPECT_NEAR (pixel.spread, std::sqrt (5.0), 1e-5);
  EXPECT_FLOAT_EQ (pixel.depth, 1002);
  EXPECT_NEAR (pixel.depth_spread, std::sqrt (8.0 / 3), 1e-4);
  EXPECT_FLOAT_EQ (pixel.depth_share, 0.75);
}

TEST (Background, empty_scene_leaves_nothing)
{
  Frame frame (99);
  segment (frame);
  EXPECT_EQ (frame.valid (), 0);
}

TEST (Background, nearer_thing_of_the_same_colour_stays)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {120, 125, 110, 0});
  segment (frame);
  EXPECT_EQ (frame.valid (20, 10, 20, 20), 400);
  EXPECT_EQ (frame.valid (), 400);
}

TEST (Background, other_colour_at_the_same_depth_stays_and_depth_alone_loses_it)
{
  Frame frame (99), depth_only (99);
  for (Frame *f : {&frame, &depth_only})
    f->put (20, 10, 20, 20, 20000, {190, 90, 80, 0});
  segment (frame);
  EXPECT_EQ (frame.valid (20, 10, 20, 20), 400);
  SegmentationSettings settings;
  settings.cue = Cue::kDepth;
  segment (depth_only, settings);
  EXPECT_EQ (depth_only.valid (), 0);
}

TEST (Background, shadow_and_light_on_the_wall_are_background)
{
  for (double brightness : {0.6, 0.8, 1.2}) {
    Frame frame (99, brightness);
    segment (frame);
    EXPECT_EQ (frame.valid (), 0) << brightness;
  }
}

TEST (Background, much_darker_thing_is_no_shadow_unless_depth_says_all_around_that_it_is_the_wall)
{
  for (const Cue cue : {Cue::kColour, Cue::kBoth}) {
    Frame frame (99);
    frame.put (20, 10, 20, 20, 20000, {20, 21, 18, 0});
    SegmentationSettings settings;
    settings.cue = cue;
    segment (frame, settings);
    EXPECT_EQ (frame.valid (), cue == Cue::kColour ? 400 : 0);
  }
}

TEST (Background, dark_thing_beside_something_nearer_is_no_shadow)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {200, 60, 60, 0});
  frame.put (40, 10, 8, 20, 20000, {20, 21, 18, 0}); /* stereo gives a rim the wall's depth */
  segment (frame);
  EXPECT_EQ (frame.valid (20, 10, 20, 20), 400);
  EXPECT_EQ (frame.valid (40, 10, 8, 20), 160);
}

TEST (Background, what_a_nearer_surface_surrounds_belongs_to_it_and_gets_its_depth)
{
  Frame frame (99);
  frame.put (10, 8, 40, 34, 12000, {200, 60, 60, 0});
  frame.put (20, 15, 14, 14, kInvalidDepth, {70, 70, 65, 0}); /* dark cloth or deep shadow */
  segment (frame);
  EXPECT_EQ (frame.valid (), 40 * 34);
  for (int y = 15; y < 29; y++)
    for (int x = 20; x < 34; x++)
      ASSERT_NEAR (frame.depth.view ().at (x, y), 12000, 240) << x << ", " << y;
}

TEST (Background, shadow_without_depth_beside_a_person_is_open_and_no_part_of_it)
{
  Frame frame (99);
  frame.put (0, 0, 30, 48, 12000, {200, 60, 60, 0});
  frame.put (30, 0, 34, 48, 20000, {36, 37, 33, 0});
  frame.put (30, 10, 6, 20, kInvalidDepth, {36, 37, 33, 0}); /* what one camera does not see */
  segment (frame);
  EXPECT_EQ (frame.valid (36, 0, 28, 48), 0);
  EXPECT_EQ (frame.valid (0, 0, 30, 48), 30 * 48);
}

/* Of 18 columns without depth beside a person. */
TEST (Background, depth_goes_on_farther_where_the_hue_differs)
{
  for (const bool hue : {true, false}) {
    Frame frame (99);
    const Rgbx colour = hue ? Rgbx{200, 60, 60, 0} : Rgbx{220, 229, 201, 0};
    frame.put (0, 0, 30, 48, 12000, colour);
    frame.put (30, 10, 18, 28, kInvalidDepth, colour);
    segment (frame);
    EXPECT_EQ (frame.valid (30, 12, 3, 24), 3 * 24) << hue;
    EXPECT_EQ (frame.valid (38, 12, 9, 24), hue ? 9 * 24 : 0) << hue;
  }
}

TEST (Surroundings, equal_a_walk_from_each_block_in_eight_directions)
{
  constexpr int kReach = 24; /* pixels: 12 blocks */
  cv::RNG random (4);
  for (const cv::Size size : {cv::Size (1, 1), {6, 3}, {97, 61}, {160, 120}}) {
    cv::Mat sides (size, CV_8U), inside;
    for (int y = 0; y < size.height; y++)
      for (int x = 0; x < size.width; x++)
        sides.at<std::uint8_t> (y, x) = std::uint8_t (random.uniform (0, 30) > 1 ? 0
                                                      : random.uniform (0, 4)    ? 2
                                                                                 : 1);
    const cv::Size blocks ((size.width + 1) / 2, (size.height + 1) / 2);
    const auto block = [&] (int bx, int by) {
      int sum = 0;
      for (int i = 0; i < 4; i++) {
        const int x = std::min (2 * bx + i % 2, size.width - 1),
                  y = std::min (2 * by + i / 2, size.height - 1),
                  side = sides.at<std::uint8_t> (y, x);
        sum += (side == 2) - (side == 1);
      }
      return sum;
    };
    const auto is_inside = [&] (int bx, int by) {
      int foreground = 0, background = 0;
      for (int i = 0; i < 9; i++) {
        const int dx = i % 3 - 1, dy = i / 3 - 1;
        if (dx == 0 && dy == 0)
          continue;
        bool found = false;
        for (int t = 1; t < kReach / 2 && !found; t++) {
          const int x = bx + t * dx, y = by + t * dy;
          const bool outside = x < 0 || y < 0 || x >= blocks.width || y >= blocks.height;
          const int sum = outside ? 0 : block (x, y);
          foreground += sum > 0;
          background += sum < 0;
          found = outside || sum != 0;
        }
        background += !found;
      }
      return foreground >= 4 && foreground >= 3 * background;
    };
    for (CpuLevel level : kCpuLevels) {
      limit_cpu (level);
      Surroundings surroundings;
      surroundings.find_inside (sides, kReach, inside);
      for (int y = 0; y < size.height; y++)
        for (int x = 0; x < size.width; x++)
          ASSERT_EQ (inside.at<std::uint8_t> (y, x) != 0,
              sides.at<std::uint8_t> (y, x) == 0 && is_inside (x / 2, y / 2))
              << size << " at " << x << ", " << y;
    }
  }
}

TEST (Surroundings, hole_in_a_thing_is_inside_and_a_corner_beside_it_is_not)
{
  cv::Mat sides (60, 81, CV_8U, cv::Scalar (int (Side::kUnknown))), inside;
  sides (cv::Rect (10, 10, 40, 8)) = int (Side::kForeground); /* a frame, */
  sides (cv::Rect (10, 10, 8, 40)) = int (Side::kForeground);
  sides (cv::Rect (42, 10, 8, 40)) = int (Side::kForeground);
  sides (cv::Rect (10, 42, 40, 8)) = int (Side::kForeground);
  Surroundings surroundings;
  surroundings.find_inside (sides, 60, inside);
  EXPECT_EQ (inside.at<std::uint8_t> (30, 30), 255);
  EXPECT_EQ (inside.at<std::uint8_t> (5, 30), 0);
  EXPECT_EQ (inside.at<std::uint8_t> (12, 30), 0) << "what is known is not asked for";
  sides (cv::Rect (18, 18, 24, 24)) = int (Side::kBackground);
  sides (cv::Rect (29, 29, 4, 4)) = int (Side::kUnknown);
  surroundings.find_inside (sides, 60, inside);
  EXPECT_EQ (inside.at<std::uint8_t> (30, 30), 0) << "background is seen through the frame";
  sides.setTo (int (Side::kUnknown));
  sides (cv::Rect (20, 40, 30, 10)) = int (Side::kForeground); /* an L */
  sides (cv::Rect (20, 10, 10, 40)) = int (Side::kForeground);
  surroundings.find_inside (sides, 20, inside);
  EXPECT_EQ (inside.at<std::uint8_t> (36, 34), 0) << "a corner";
}

TEST (Surroundings, reach_and_picture_edge_end_what_is_seen)
{
  for (const auto [reach, in] : {std::pair{40, 255}, std::pair{8, 0}}) {
    cv::Mat sides (40, 40, CV_8U, cv::Scalar (int (Side::kForeground))), inside;
    sides (cv::Rect (6, 6, 28, 28)) = int (Side::kUnknown);
    Surroundings ().find_inside (sides, reach, inside);
    EXPECT_EQ (inside.at<std::uint8_t> (20, 20), in) << reach;
  }
  for (const cv::Size size : {cv::Size (1, 1), cv::Size (1, 7), cv::Size (7, 1)})
    for (const Side side : {Side::kUnknown, Side::kForeground}) {
      cv::Mat sides (size, CV_8U, cv::Scalar (int (side))), inside;
      Surroundings ().find_inside (sides, 255, inside);
      EXPECT_EQ (cv::countNonZero (inside), 0);
    }
}

TEST (Background, depth_of_a_burnt_out_wall_is_that_of_the_wall_around_it)
{
  BackgroundModel model;
  model.reset (kWidth, kHeight);
  for (unsigned i = 0; i < 20; i++) {
    Frame frame (i);
    frame.put (20, 10, 20, 20, kInvalidDepth, {255, 255, 255, 0});
    EXPECT_TRUE (model.learn (frame.image ()).ok ());
  }
  model.finish ();
  EXPECT_NEAR (model.inferred_depth (20)[30], 20000, 100);
  EXPECT_EQ (model.inferred_depth (5)[5], 0); /* it has depth of its own */
  Frame shaded (99);
  shaded.put (20, 10, 20, 20, 20000, {60, 60, 60, 0}); /* a shadow falls there: stereo finds it */
  Segmenter segmenter;
  ASSERT_TRUE (segmenter.clear_background (shaded.image (), model, 1e-4, {}).ok ());
  EXPECT_EQ (shaded.valid (), 0);
}

TEST (Background, small_island_goes_and_small_hole_closes)
{
  Frame frame (99);
  frame.put (5, 5, 6, 6, 12000, {200, 60, 60, 0});
  frame.put (20, 10, 30, 30, 12000, {200, 60, 60, 0});
  frame.put (30, 20, 4, 4, 12000, {120, 125, 110, 0}); /* the wall's colour */
  segment (frame);
  EXPECT_EQ (frame.valid (5, 5, 6, 6), 0);
  EXPECT_EQ (frame.valid (30, 20, 4, 4), 16);
}

TEST (Background, small_island_in_space_goes_although_it_touches_the_person_in_the_picture)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {190, 90, 80, 0});
  frame.put (40, 10, 5, 5, 12600, {190, 90, 80, 0}); /* 60 mm behind the person's edge */
  frame.put (40, 20, 5, 5, 12200, {190, 90, 80, 0}); /* 20 mm: still the person */
  SegmentationSettings settings;
  settings.fill = 0; /* the person's surface would go on there */
  segment (frame, settings);
  EXPECT_EQ (frame.valid (40, 10, 5, 5), 0);
  EXPECT_EQ (frame.valid (40, 20, 5, 5), 25);
  EXPECT_EQ (frame.valid (20, 10, 20, 20), 400);
}

TEST (Background, closing_a_hole_makes_no_depth)
{
  Frame frame (99);
  frame.put (20, 10, 30, 30, 12000, {200, 60, 60, 0});
  frame.put (30, 20, 4, 4, kInvalidDepth, {120, 125, 110, 0});
  segment (frame);
  EXPECT_EQ (frame.valid (30, 20, 4, 4), 0);
  EXPECT_EQ (frame.valid (), 900 - 16);
}

TEST (Background, roi_is_compared_with_its_own_part_of_the_background)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {200, 60, 60, 0});
  const RangeImage part = {0, {15, 8, 40, 35}, frame.depth.view ().crop (15, 8, 40, 35),
      frame.colour.view ().crop (15, 8, 40, 35), 0};
  Segmenter segmenter;
  ASSERT_TRUE (segmenter.clear_background (part, learnt_wall (), 1e-4, {}).ok ());
  EXPECT_EQ (frame.valid (15, 8, 40, 35), 400);
  EXPECT_EQ (frame.valid (0, 0, 15, 48), 15 * 48) << "outside the ROI nothing may be written";
}

TEST (Background, roi_outside_the_background_is_refused)
{
  Frame frame (99);
  RangeImage image = frame.image ();
  image.roi.x = 1;
  Segmenter segmenter;
  EXPECT_EQ (
      segmenter.clear_background (image, learnt_wall (), 1e-4, {}).code (), StatusCode::kBadSize);
  BackgroundModel model;
  model.reset (kWidth, kHeight);
  EXPECT_EQ (model.learn (image).code (), StatusCode::kBadSize);
}

/* A background file of one view, and the image beside it. */
struct BackgroundFiles {
  std::string stem = ::testing::TempDir () + "background-" + std::to_string (getpid ());
  std::string list = stem + ".yml", image = stem + "-3.pgm";
  std::vector<std::pair<int, BackgroundModel>> loaded;

  ~BackgroundFiles ()
  {
    std::filesystem::remove (list);
    std::filesystem::remove (image);
  }
  Status load () { return load_backgrounds (list, loaded); }
};

TEST (Background, file_gives_the_same_decisions)
{
  BackgroundFiles files;
  const BackgroundModel model = learnt_wall ();
  ASSERT_TRUE (save_backgrounds (files.list, {{3, &model}}).ok ());
  const Status status = files.load ();
  ASSERT_TRUE (status.ok ()) << status.message ();
  ASSERT_EQ (files.loaded.size (), 1u);
  EXPECT_EQ (files.loaded[0].first, 3);
  const BackgroundModel &read = files.loaded[0].second;
  EXPECT_EQ (read.frames (), 20);
  EXPECT_NEAR (read.depth_noise (), model.depth_noise (), 0.01 * model.depth_noise ());
  for (int x = 0; x < kWidth; x++) {
    const BackgroundPixel &a = read.row (7)[x], &b = model.row (7)[x];
    EXPECT_NEAR (a.mean[1], b.mean[1], 0.002);
    EXPECT_NEAR (a.spread, b.spread, 0.002);
    EXPECT_NEAR (a.depth, b.depth, 0.5);
    EXPECT_NEAR (a.depth_spread, b.depth_spread, 0.032);
    EXPECT_NEAR (a.depth_share, b.depth_share, 1e-5);
    EXPECT_EQ (a.nearest, b.nearest);
  }
}

TEST (Background, bad_files_are_named)
{
  BackgroundFiles files;
  EXPECT_EQ (files.load ().code (), StatusCode::kNotFound);
  for (const char *text : {"", "hello", "%YAML:1.0\n---\nrangecast_background: 2\n",
           "%YAML:1.0\n---\nrangecast_background: 3\nviews:\n  - { id: 0 }\n",
           "%YAML:1.0\n---\nrangecast_background: 3\nviews:\n  - { id: 64, frames: 1 }\n",
           "%YAML:1.0\n---\nrangecast_background: 3\nviews:\n  - { id: 3, frames: 1 }\n"}) {
    std::ofstream (files.list) << text;
    const Status status = files.load ();
    EXPECT_EQ (status.code (), StatusCode::kBadData) << text;
    EXPECT_TRUE (status.message ().starts_with (files.stem)) << status.message ();
  }
}

TEST (Background, image_that_is_damaged_or_cut_is_refused)
{
  BackgroundFiles files;
  const BackgroundModel model = learnt_wall ();
  ASSERT_TRUE (save_backgrounds (files.list, {{3, &model}}).ok ());
  std::ifstream saved (files.image, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char> (saved), {}};
  for (const std::string &bad : {std::string (), whole.substr (0, 5), whole.substr (0, 2000),
           whole.substr (0, whole.size () - 1), "P6" + whole.substr (2),
           std::string ("P5\n99999999 99999992\n65535\n"), std::string ("P5\n-8 8\n65535\n")}) {
    std::ofstream (files.image, std::ios::binary) << bad;
    const Status status = files.load ();
    EXPECT_FALSE (status.ok ());
    EXPECT_TRUE (status.message ().starts_with (files.image)) << status.message ();
    EXPECT_TRUE (files.loaded.empty ());
  }
}

TEST (Background, wall_that_wavers_between_two_depths_does_not_hide_what_is_before_both)
{
  BackgroundModel model;
  model.reset (kWidth, kHeight);
  for (unsigned i = 0; i < 20; i++) {
    Frame frame (i);
    if (i % 2) /* as stereo does at the edge of a cupboard */
      for (int y = 5; y < 35; y++)
        for (int x = 15; x < 45; x++)
          frame.depth.view ().at (x, y) = 12000;
    ASSERT_TRUE (model.learn (frame.image ()).ok ());
  }
  model.finish ();
  Frame frame (99);
  frame.put (20, 10, 20, 20, 8000, {120, 125, 110, 0});
  Segmenter segmenter;
  ASSERT_TRUE (segmenter.clear_background (frame.image (), model, 1e-4, {}).ok ());
  EXPECT_EQ (frame.valid (), 400);
}

TEST (Background, only_as_many_of_the_largest_islands_stay_as_asked_for)
{
  for (const int people : {0, 1, 2}) {
    Frame frame (99);
    frame.put (2, 5, 14, 20, 12000, {200, 60, 60, 0});
    frame.put (20, 5, 15, 30, 12000, {200, 60, 60, 0});
    frame.put (40, 5, 20, 20, 12000, {200, 60, 60, 0});
    SegmentationSettings settings;
    settings.max_people = people;
    segment (frame, settings);
    EXPECT_EQ (frame.valid (), people == 0 ? 280 + 450 + 400 : people == 1 ? 450 : 850);
  }
}
