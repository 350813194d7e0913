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

  explicit Frame (unsigned seed, double brightness = 1, double depth_noise = 40)
  {
    std::mt19937 random (seed);
    std::normal_distribution<double> grey (0, 2), range (0, depth_noise);
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
learnt_wall (double depth_noise = 40)
{
  BackgroundModel model;
  model.reset (kWidth, kHeight);
  for (unsigned i = 0; i < 20; i++)
    EXPECT_TRUE (model.learn (Frame (i, 1, depth_noise).image ()).ok ());
  model.finish ();
  return model;
}

void
segment (Frame &frame, const SegmentationSettings &settings = {})
{
  Segmenter segmenter;
  const BackgroundModel wall = learnt_wall ();
  ASSERT_TRUE (segmenter.decide (frame.image (), wall, 1e-4, settings).ok ());
  ASSERT_TRUE (segmenter.clear (frame.image (), wall, 1e-4, settings).ok ());
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

TEST (Background, nearer_thing_of_the_same_colour_stays)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {120, 125, 110, 0});
  segment (frame);
  EXPECT_EQ (frame.valid (20, 10, 20, 20), 400);
  EXPECT_EQ (frame.valid (), 400);
}

TEST (Background, other_colour_at_the_walls_depth_stays_beside_what_is_nearer_and_alone_is_the_wall)
{
  for (const int fringe : {9, 0}) {
    Frame frame (99);
    frame.put (0, 0, 10, 48, 19740, {190, 90, 80, 0});
    frame.put (10, 10, 6, 20, 20000, {190, 90, 80, 0});  /* a foot */
    frame.put (40, 10, 20, 20, 20000, {190, 90, 80, 0}); /* a screen */
    SegmentationSettings settings;
    settings.fringe = fringe;
    segment (frame, settings);
    EXPECT_EQ (frame.valid (0, 0, 16, 48), 10 * 48 + 6 * 20) << fringe;
    EXPECT_EQ (frame.valid (40, 0, 24, 48), 0) << fringe;
  }
}

TEST (Background, colour_decides_where_noise_is_larger_than_the_distance_from_the_wall)
{
  for (const std::uint16_t z : {std::uint16_t{17000}, std::uint16_t{20000}}) {
    Frame frame (99, 1, 1200);
    std::mt19937 random (7);
    std::normal_distribution<double> noise (z, 1200);
    for (int y = 10; y < 40; y++)
      for (int x = 15; x < 50; x++)
        frame.put (x, y, 1, 1, std::uint16_t (noise (random)), {190, 90, 80, 0});
    Segmenter segmenter;
    SegmentationSettings settings;
    settings.min_area = settings.fill = 0; /* islands in space: that noise is larger than 30 mm */
    ASSERT_TRUE (segmenter.decide (frame.image (), learnt_wall (1200), 1e-4, settings).ok ());
    const int found = cv::countNonZero (segmenter.mask () (cv::Rect (15, 10, 35, 30)));
    if (z == 17000)
      EXPECT_GT (found, 1000);
    else
      EXPECT_LT (found, 20);
  }
}

namespace {

/* The wall goes, for so long; another one is behind it. */
BackgroundModel
model_after_another_wall (double seconds, const SegmentationSettings &settings)
{
  BackgroundModel model = learnt_wall ();
  Segmenter segmenter;
  std::mt19937 random (5);
  const auto show = [&] (double time_s, bool behind) {
    Frame frame (unsigned (100 + 10 * time_s));
    if (behind)
      frame.put (0, 0, kWidth, kHeight, 26000, {60, 80, 150, 0});
    for (int i = 0; i < kWidth * kHeight / 3; i++) /* as stereo has it */
      frame.depth.view ().at (int (random () % kWidth), int (random () % kHeight)) = kInvalidDepth;
    RangeImage image = frame.image ();
    image.capture_time_ns = std::uint64_t (1e9 + 1e9 * time_s);
    EXPECT_TRUE (segmenter.decide (image, model, 1e-4, settings).ok ());
    EXPECT_EQ (cv::countNonZero (segmenter.mask ()), 0) << time_s;
    const cv::Mat &quiet = segmenter.quiet ();
    model.adapt (image, {quiet.data, quiet.cols, quiet.rows, std::ptrdiff_t (quiet.step)},
        segmenter.light (), 30);
  };
  for (double t = 0; t < seconds; t += 0.2)
    show (t, true);
  if (seconds < 3)
    show (seconds, false);
  return model;
}

} // namespace

TEST (Background, what_is_behind_the_wall_is_background_and_learnt_after_three_seconds)
{
  for (const Cue cue : {Cue::kBoth, Cue::kDepth}) {
    SegmentationSettings settings;
    settings.cue = cue;
    settings.follow_light = false;
    const BackgroundModel early = model_after_another_wall (2.5, settings),
                          late = model_after_another_wall (3.5, settings);
    const BackgroundPixel &before = early.row (20)[30], &after = late.row (20)[30];
    EXPECT_NEAR (before.depth, 20000, 60);
    EXPECT_NEAR (before.mean[2], 110, 3);
    EXPECT_NEAR (after.depth, 26000, 1);
    EXPECT_NEAR (after.nearest, 26000, 1);
    EXPECT_NEAR (after.mean[2], 150, 1);
    EXPECT_LT (after.spread, 1);
  }
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

TEST (Background, roi_is_compared_with_its_own_part_of_the_background)
{
  Frame frame (99);
  frame.put (20, 10, 20, 20, 12000, {200, 60, 60, 0});
  const RangeImage part = {0, {15, 8, 40, 35}, frame.depth.view ().crop (15, 8, 40, 35),
      frame.colour.view ().crop (15, 8, 40, 35), 0};
  Segmenter segmenter;
  ASSERT_TRUE (segmenter.decide (part, learnt_wall (), 1e-4, {}).ok ());
  ASSERT_TRUE (segmenter.clear (part, learnt_wall (), 1e-4, {}).ok ());
  EXPECT_EQ (frame.valid (15, 8, 40, 35), 400);
  EXPECT_EQ (frame.valid (0, 0, 15, 48), 15 * 48) << "outside the ROI nothing may be written";
}

TEST (Background, roi_outside_the_background_is_refused)
{
  Frame frame (99);
  RangeImage image = frame.image ();
  image.roi.x = 1;
  Segmenter segmenter;
  EXPECT_EQ (segmenter.decide (image, learnt_wall (), 1e-4, {}).code (), StatusCode::kBadSize);
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
