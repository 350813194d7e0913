/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <new>
#include <random>
#include <rangecast/overlap/colour_match.hpp>

/* Counts what is allocated, for the tests that nothing is. Not inlined, or compilers see a free
 * that has no malloc and warn. */
static std::atomic<int> allocations;

[[gnu::noinline]] void *
operator new (std::size_t size)
{
  allocations++;
  if (void *memory = std::malloc (size ? size : 1))
    return memory;
  throw std::bad_alloc ();
}
[[gnu::noinline]] void
operator delete (void *memory) noexcept
{
  std::free (memory);
}
[[gnu::noinline]] void
operator delete (void *memory, std::size_t) noexcept
{
  std::free (memory);
}

namespace rangecast {
namespace {

constexpr int kWidth = 160, kHeight = 120;
constexpr double kRadius = 0.2; ///< of the ball that is seen, metres

struct Rgb {
  double r, g, b;
};

/** What cameras on an arc about a ball see; ROIs are the whole pictures. */
struct Frame {
  Rig rig;
  std::vector<std::vector<std::uint16_t>> depth;
  std::vector<std::vector<Rgbx>> colour;

  std::vector<RangeImage> images ()
  {
    std::vector<RangeImage> all;
    for (std::size_t i = 0; i < rig.views.size (); i++)
      all.push_back ({rig.views[i].id, {0, 0, kWidth, kHeight},
          {depth[i].data (), kWidth, kHeight, kWidth * 2},
          {colour[i].data (), kWidth, kHeight, kWidth * 4}, 0});
    return all;
  }
};

/** A camera 0.8 m from the origin, `degrees` about the vertical from +z. */
View
camera_at (int id, double degrees)
{
  const double a = degrees * M_PI / 180, s = std::sin (a), c = std::cos (a);
  View view;
  view.id = id;
  view.width = kWidth;
  view.height = kHeight;
  view.intrinsics = {1.2 * kWidth, 1.2 * kWidth, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0};
  view.world_from_view = {{c, 0, -s, 0, -1, 0, -s, 0, -c}, {0.8 * s, 0, 0.8 * c}};
  return view;
}

std::uint8_t
to_byte (double v)
{
  return static_cast<std::uint8_t> (std::lround (std::clamp (v, 0.0, 255.0)));
}

/** A ball painted in soft stripes, as cameras with these gains see it. */
Frame
ball (const std::vector<double> &degrees, const std::vector<Rgb> &gains)
{
  Frame frame;
  for (std::size_t i = 0; i < degrees.size (); i++) {
    const View view = camera_at (static_cast<int> (i), degrees[i]);
    frame.rig.views.push_back (view);
    auto &depth = frame.depth.emplace_back (kWidth * kHeight);
    auto &colour = frame.colour.emplace_back (kWidth * kHeight);
    const Vec3 o = view.world_from_view.translation;
    for (int k = 0; k < kWidth * kHeight; k++) {
      const Vec3 ray =
          view.world_from_view.rotation * view.intrinsics.unproject (k % kWidth, k / kWidth, 1);
      const double a = dot (ray, ray), b = dot (o, ray),
                   root = b * b - a * (dot (o, o) - kRadius * kRadius);
      if (root < 0)
        continue;
      const double z = (-b - std::sqrt (root)) / a;
      const Vec3 p = o + z * ray;
      const auto at = static_cast<std::size_t> (k);
      depth[at] = static_cast<std::uint16_t> (std::lround (z / view.depth_unit_m));
      colour[at] = {to_byte (gains[i].r * (130 + 50 * std::sin (20 * p.x))),
          to_byte (gains[i].g * (110 + 40 * std::sin (25 * p.y))),
          to_byte (gains[i].b * (120 + 40 * std::sin (22 * p.z))), 0};
    }
  }
  return frame;
}

const std::vector<double> kArc = {0, 30, 60, 90};
const Rgb kOne{1, 1, 1};

/** How far the gains of all views that were found are from those that make all agree. */
double
worst_gain (const ColourBalance &balance, const std::vector<Rgb> &wrong)
{
  double worst = 0;
  for (std::size_t c = 0; c < 3; c++) {
    const auto of = [&] (std::size_t i) {
      return c == 0 ? wrong[i].r : c == 1 ? wrong[i].g : wrong[i].b;
    };
    std::vector<double> logs;
    for (std::size_t i = 0; i < wrong.size (); i++)
      logs.push_back (std::log (of (i)));
    std::ranges::sort (logs);
    const double middle = (logs[(logs.size () - 1) / 2] + logs[logs.size () / 2]) / 2;
    for (std::size_t i = 0; i < wrong.size (); i++) {
      const double left =
          std::log (of (i)) - middle + std::log (double{balance.gains (static_cast<int> (i))[c]});
      worst = std::max (worst, std::abs (left));
    }
  }
  return worst;
}

const std::vector<Rgb> kWrong = {{1.1, 1, 0.93}, {0.92, 1, 1.05}, {1, 0.9, 1}, {1, 1.08, 0.95}};

TEST (ColourBalance, cameras_that_disagree_are_made_to_agree)
{
  Frame frame = ball (kArc, kWrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  EXPECT_LT (worst_gain (balance, kWrong), 0.01);
}

/** The largest of all pairs' and channels' mean differences over what both see, levels. Exact
 *  depth, so a point of one view is looked up in the other one. */
double
worst_mean_difference (Frame &frame)
{
  ColourCameras cameras;
  EXPECT_TRUE (cameras.set (frame.rig).ok ());
  const std::vector<RangeImage> images = frame.images ();
  double worst = 0;
  for (std::size_t i = 0; i < images.size (); i++)
    for (std::size_t j = i + 1; j < images.size (); j++) {
      double sum[3] = {}, n = 0;
      for (int y = 0; y < kHeight; y++)
        for (int x = 0; x < kWidth; x++) {
          float point[3];
          ColourCameras::Place place;
          if (!images[i].depth.at (x, y))
            continue;
          cameras.point (images[i], x, y, images[i].depth.at (x, y), point);
          if (!cameras.find (images[j], point, place))
            continue;
          const int u = ColourCameras::column (place), v = ColourCameras::row (place);
          if (std::abs (images[j].depth.at (u, v) - place.depth) > 40)
            continue;
          const Rgbx a = images[i].colour.at (x, y), b = images[j].colour.at (u, v);
          sum[0] += a.r - b.r, sum[1] += a.g - b.g, sum[2] += a.b - b.b;
          n++;
        }
      if (n > 300)
        for (const double s : sum)
          worst = std::max (worst, std::abs (s) / n);
    }
  return worst;
}

/** As a camera whose light differs before its curve (sRGB) has the colours. */
void
change_light (Frame &frame, const std::vector<Rgb> &gains)
{
  const auto changed = [] (std::uint8_t value, double gain) {
    const double v = value / 255.0,
                 linear = gain * (v <= 0.04045 ? v / 12.92 : std::pow ((v + 0.055) / 1.055, 2.4));
    return to_byte (
        255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow (linear, 1 / 2.4) - 0.055));
  };
  for (std::size_t i = 0; i < gains.size (); i++)
    for (Rgbx &c : frame.colour[i])
      c = {changed (c.r, gains[i].r), changed (c.g, gains[i].g), changed (c.b, gains[i].b), 0};
}

TEST (ColourBalance, cameras_that_differ_by_a_tenth_differ_by_less_than_a_level_afterwards)
{
  const std::vector<Rgb> tenth = {{1.1, 0.9, 1}, {0.9, 1.1, 1.1}, {1, 1.1, 0.9}, {1.1, 1, 0.9}};
  for (const bool before_the_curve : {false, true}) {
    Frame frame = ball (kArc, before_the_curve ? std::vector<Rgb> (4, kOne) : tenth);
    if (before_the_curve)
      change_light (frame, tenth);
    EXPECT_GT (worst_mean_difference (frame), 5);
    ColourBalance balance;
    ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
    ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
    EXPECT_LT (worst_mean_difference (frame), 1) << before_the_curve;
  }
}

TEST (ColourBalance, colours_are_multiplied_by_the_gains)
{
  Frame frame = ball (kArc, kWrong);
  const Frame before = frame;
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 2).ok ());
  for (std::size_t i = 0; i < kArc.size (); i++)
    for (std::size_t k = 0; k < frame.colour[i].size (); k++) {
      const ColourBalance::Gains g = balance.gains (static_cast<int> (i));
      const Rgbx was = before.colour[i][k], is = frame.colour[i][k];
      ASSERT_NEAR (is.r, std::min (255.0f, g[0] * was.r), 0.51);
      ASSERT_NEAR (is.g, std::min (255.0f, g[1] * was.g), 0.51);
      ASSERT_NEAR (is.b, std::min (255.0f, g[2] * was.b), 0.51);
    }
  EXPECT_EQ (frame.depth, before.depth);
}

TEST (ColourBalance, cameras_that_agree_are_left_alone_bit_by_bit)
{
  Frame frame = ball (kArc, {kOne, kOne, kOne, kOne});
  const Frame before = frame;
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  for (int id = 0; id < 4; id++)
    EXPECT_EQ (balance.gains (id), (ColourBalance::Gains{1, 1, 1}));
  for (std::size_t i = 0; i < kArc.size (); i++)
    for (std::size_t k = 0; k < frame.colour[i].size (); k++) {
      ASSERT_EQ (frame.colour[i][k].r, before.colour[i][k].r);
      ASSERT_EQ (frame.colour[i][k].g, before.colour[i][k].g);
      ASSERT_EQ (frame.colour[i][k].b, before.colour[i][k].b);
    }
}

TEST (ColourBalance, highlights_of_one_camera_do_not_count)
{
  Frame frame = ball (kArc, kWrong);
  for (std::size_t k = 0; k < frame.colour[1].size (); k++)
    if (k % 10 < 3) /* three in ten: a mean would be 9 % off */
      frame.colour[1][k] = {240, 240, 240, 0};
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  EXPECT_LT (worst_gain (balance, kWrong), 0.04);
}

TEST (ColourBalance, what_is_behind_another_surface_does_not_count)
{
  /* View 1 has something else, and very green, 5 cm before the ball. */
  Frame frame = ball ({0, 20}, {kOne, kOne});
  for (std::size_t k = 0; k < frame.depth[1].size (); k++)
    if (frame.depth[1][k]) {
      frame.depth[1][k] = static_cast<std::uint16_t> (frame.depth[1][k] - 500);
      frame.colour[1][k] = {60, 200, 60, 0};
    }
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  EXPECT_EQ (balance.gains (0)[1], 1);
  EXPECT_EQ (balance.gains (1)[1], 1);
}

TEST (ColourBalance, views_without_overlap_keep_their_colours)
{
  const std::vector<Rgb> wrong = {{1.2, 1.2, 1.2}, {0.8, 0.8, 0.8}};
  Frame frame = ball ({0, 180}, wrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  for (int id : {0, 1, 7, -1, 64})
    EXPECT_EQ (balance.gains (id), (ColourBalance::Gains{1, 1, 1}));
}

TEST (ColourBalance, no_gain_is_larger_than_the_bound)
{
  const std::vector<Rgb> wrong = {{0.46, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  Frame frame = ball (kArc, wrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  EXPECT_GT (balance.gains (0)[0], 1.4);
  EXPECT_LE (balance.gains (0)[0], ColourBalance::kMaxGain);
}

TEST (ColourBalance, camera_with_another_exposure_is_lifted_and_the_others_stay)
{
  Frame frame = ball (kArc, {kOne, {0.6, 0.6, 0.6}, kOne, kOne});
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  for (std::size_t c = 0; c < 3; c++) {
    EXPECT_NEAR (balance.gains (1)[c], 1 / 0.6, 0.02);
    for (const int other : {0, 2, 3})
      EXPECT_NEAR (balance.gains (other)[c], 1, 0.005);
  }
}

TEST (ColourBalance, gains_follow_a_change_slowly_but_come_there)
{
  ColourBalance balance;
  const std::vector<Rgb> wrong = {{0.8, 0.8, 0.8}, kOne, kOne, kOne};
  const Frame right = ball (kArc, {kOne, kOne, kOne, kOne}), changed = ball (kArc, wrong);
  Frame frame = right;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  for (int i = 0; i < 60; i++) {
    frame.colour = right.colour;
    ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  }
  float after_one = 0;
  for (int i = 0; i < 60; i++) { /* no more than before: what was long ago must not count */
    frame.colour = changed.colour;
    ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
    if (i == 0)
      after_one = balance.gains (0)[0];
  }
  EXPECT_LT (after_one, 1.05);
  EXPECT_LT (worst_gain (balance, wrong), 0.015);
  balance.reset ();
  EXPECT_EQ (balance.gains (0), (ColourBalance::Gains{1, 1, 1}));
}

TEST (ColourBalance, view_that_is_missing_keeps_its_gains)
{
  Frame frame = ball (kArc, kWrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  const ColourBalance::Gains gains = balance.gains (3);
  frame = ball (kArc, kWrong);
  std::vector<RangeImage> three = frame.images ();
  three.pop_back ();
  ASSERT_TRUE (balance.process (three, 1).ok ());
  EXPECT_EQ (balance.gains (3), gains);
}

/* The log gains of views 0 .. 2. */
static std::array<double, 9>
first_gains (const ColourBalance &balance)
{
  std::array<double, 9> logs{};
  for (std::size_t k = 0; k < 9; k++)
    logs[k] = std::log (double{balance.gains (static_cast<int> (k / 3))[k % 3]});
  return logs;
}

TEST (ColourBalance, gains_do_not_move_when_a_view_is_missing_for_a_frame)
{
  /* Little noise in what is sampled here and there; without the last view their mean is another. */
  const std::vector<Rgb> wrong = {{1, 1, 1}, {1.03, 0.98, 1}, {1, 1.02, 0.97}, {1.4, 1.35, 1.3}};
  const Frame fresh = ball (kArc, wrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (fresh.rig).ok ());
  const auto shoot = [&] (bool missing) {
    Frame frame = fresh;
    std::vector<RangeImage> images = frame.images ();
    if (missing)
      images.pop_back ();
    ASSERT_TRUE (balance.process (images, 1).ok ());
  };
  for (int i = 0; i < 20; i++)
    shoot (false);
  for (int i = 0; i < 6; i++) {
    const auto before = first_gains (balance);
    shoot (i % 2 == 0);
    const auto after = first_gains (balance);
    for (std::size_t k = 0; k < before.size (); k++)
      EXPECT_NEAR (after[k], before[k], 0.0008) << i << " " << k;
  }
}

TEST (ColourBalance, views_may_come_in_any_order)
{
  Frame frame = ball (kArc, kWrong);
  std::vector<RangeImage> images = frame.images ();
  std::reverse (images.begin (), images.end ());
  std::swap (images[1], images[2]);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (images, 1).ok ());
  EXPECT_LT (worst_gain (balance, kWrong), 0.01);
}

TEST (ColourBalance, view_that_comes_alone_is_multiplied_by_the_gain_that_it_had)
{
  Frame frame = ball (kArc, kWrong);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  ASSERT_TRUE (balance.process (frame.images (), 1).ok ());
  const auto is_same = [] (const std::vector<Rgbx> &a, const std::vector<Rgbx> &b) {
    return std::memcmp (a.data (), b.data (), a.size () * sizeof (Rgbx)) == 0;
  };
  const std::vector<Rgbx> with_others = frame.colour[0];
  frame = ball (kArc, kWrong);
  ASSERT_FALSE (is_same (frame.colour[0], with_others));
  std::vector<RangeImage> alone = frame.images ();
  alone.resize (1);
  ASSERT_TRUE (balance.process (alone, 1).ok ());
  EXPECT_TRUE (is_same (frame.colour[0], with_others));
}

TEST (ColourBalance, images_without_pixels_or_colour_are_left_out)
{
  Frame frame = ball (kArc, kWrong);
  std::vector<RangeImage> images = frame.images ();
  images[1].colour = {};
  images[2].depth = {};
  images[2].colour = {};
  images[2].roi = {};
  images[3].roi = {5, 5, 1, 1};
  images[3].depth = images[3].depth.crop (5, 5, 1, 1);
  images[3].colour = images[3].colour.crop (5, 5, 1, 1);
  ColourBalance balance;
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  EXPECT_TRUE (balance.process (images, 1).ok ());
  EXPECT_TRUE (balance.process ({}, 1).ok ());
}

TEST (ColourBalance, unknown_views_and_too_many_are_refused_by_name)
{
  Frame frame = ball ({0, 30}, {kOne, kOne});
  ColourBalance balance;
  EXPECT_EQ (balance.process (frame.images (), 1).code (), StatusCode::kNotFound);
  ASSERT_TRUE (balance.set_rig (frame.rig).ok ());
  std::vector<RangeImage> images = frame.images ();
  images[1].view_id = 9;
  const Status status = balance.process (images, 1);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("view 9"), std::string::npos);
  images[1].view_id = -1;
  EXPECT_EQ (balance.process (images, 1).code (), StatusCode::kNotFound);
  images.assign (65, frame.images ()[0]);
  EXPECT_EQ (balance.process (images, 1).code (), StatusCode::kBadSize);
}

/* ---- blend ---- */

/** Two cameras at one place before a wall 0.8 m away, the left half of which the first one keeps
 *  and the right half the second. */
struct Wall {
  Frame frame;
  ColourBlend blend;

  explicit Wall (const std::function<Rgbx (int view, int x, int y)> &colour)
  {
    for (int id : {0, 1}) {
      frame.rig.views.push_back (camera_at (id, 0));
      frame.depth.emplace_back (kWidth * kHeight, 8000);
      auto &pixels = frame.colour.emplace_back ();
      for (int k = 0; k < kWidth * kHeight; k++)
        pixels.push_back (colour (id, k % kWidth, k / kWidth));
    }
  }
  void clear_halves ()
  {
    for (int k = 0; k < kWidth * kHeight; k++)
      frame.depth[k % kWidth < kWidth / 2 ? 1 : 0][static_cast<std::size_t> (k)] = 0;
  }
  Status run (double width_m)
  {
    Status status = blend.set_rig (frame.rig);
    if (status.ok ())
      status = blend.remember (frame.images ());
    clear_halves ();
    return status.ok () ? blend.blend (frame.images (), width_m, 1) : status;
  }
  /** Red of the view that has the column, in a row. */
  [[nodiscard]] int red (int x, int y = 60) const
  {
    return frame.colour[x < kWidth / 2 ? 0 : 1][static_cast<std::size_t> (y * kWidth + x)].r;
  }
};

Rgbx
grey (int value)
{
  const auto v = static_cast<std::uint8_t> (value);
  return {v, v, v, 0};
}

/* A pixel of the wall is 4.2 mm wide. */
constexpr double kPixel = 0.8 / (1.2 * kWidth);

TEST (ColourBlend, colours_meet_at_the_seam_and_are_their_own_beyond_the_width)
{
  Wall wall ([] (int view, int, int) { return grey (view ? 140 : 100); });
  ASSERT_TRUE (wall.run (10 * kPixel).ok ());
  EXPECT_NEAR (wall.red (79), 120, 3);
  EXPECT_NEAR (wall.red (80), 120, 3);
  EXPECT_EQ (wall.red (60), 100);
  EXPECT_EQ (wall.red (100), 140);
  for (int x = 61; x < 100; x++) {
    EXPECT_GE (wall.red (x), wall.red (x - 1)) << x;
    EXPECT_LE (wall.red (x), wall.red (x - 1) + 6) << x;
  }
}

TEST (ColourBlend, reaches_as_far_as_the_width_says)
{
  for (int pixels : {5, 20, 40}) {
    Wall wall ([] (int view, int, int) { return grey (view ? 160 : 80); });
    ASSERT_TRUE (wall.run (pixels * kPixel).ok ());
    EXPECT_EQ (wall.red (79 - pixels - 1), 80) << pixels;
    EXPECT_NE (wall.red (79 - pixels / 2), 80) << pixels;
  }
}

TEST (ColourBlend, depth_and_cleared_pixels_are_not_touched)
{
  Wall wall ([] (int view, int x, int) { return grey (view ? 140 + x % 7 : 100 + x % 5); });
  const Frame before = wall.frame;
  ASSERT_TRUE (wall.run (0.05).ok ());
  Wall cleared ([] (int, int, int) { return grey (0); });
  cleared.clear_halves ();
  EXPECT_EQ (wall.frame.depth, cleared.frame.depth);
  for (std::size_t i : {0, 1})
    for (std::size_t k = 0; k < before.colour[i].size (); k++)
      if (!wall.frame.depth[i][k]) {
        ASSERT_EQ (wall.frame.colour[i][k].r, before.colour[i][k].r);
      }
}

TEST (ColourBlend, fine_texture_stays_the_winners_own)
{
  /* The same checks in both, a pixel apart, as if a pose were wrong: mixing would level them. */
  Wall wall ([] (int view, int x, int y) { return grey (((x + view + y) & 1) ? 160 : 80); });
  ASSERT_TRUE (wall.run (0.05).ok ());
  for (int x = 60; x < 100; x++)
    EXPECT_GT (std::abs (wall.red (x) - wall.red (x, 61)), 70) << x;
}

TEST (ColourBlend, does_not_reach_across_a_depth_step)
{
  Wall wall ([] (int view, int, int) { return grey (view ? 140 : 100); });
  /* From column 76 leftwards both see another wall, 10 cm behind. */
  for (auto &depth : wall.frame.depth)
    for (int k = 0; k < kWidth * kHeight; k++)
      if (k % kWidth <= 76)
        depth[static_cast<std::size_t> (k)] = 9000;
  ASSERT_TRUE (wall.run (0.1).ok ());
  EXPECT_NEAR (wall.red (77), 120, 8);
  for (int x = 40; x <= 76; x++)
    EXPECT_EQ (wall.red (x), 100) << x;
}

TEST (ColourBlend, where_nothing_was_cleared_nothing_changes)
{
  Wall wall ([] (int view, int, int) { return grey (view ? 140 : 100); });
  ASSERT_TRUE (wall.blend.set_rig (wall.frame.rig).ok ());
  ASSERT_TRUE (wall.blend.remember (wall.frame.images ()).ok ());
  ASSERT_TRUE (wall.blend.blend (wall.frame.images (), 0.05, 1).ok ());
  for (std::size_t k = 0; k < wall.frame.colour[0].size (); k++) {
    ASSERT_EQ (wall.frame.colour[0][k].r, 100);
    ASSERT_EQ (wall.frame.colour[1][k].r, 140);
  }
  Wall none ([] (int view, int, int) { return grey (view ? 140 : 100); });
  ASSERT_TRUE (none.run (0).ok ());
  EXPECT_EQ (none.red (79), 100);
}

TEST (ColourBlend, other_images_than_were_remembered_are_refused)
{
  Wall wall ([] (int, int, int) { return grey (100); });
  EXPECT_EQ (wall.blend.blend (wall.frame.images (), 0.05, 1).code (), StatusCode::kBadSize);
  ASSERT_TRUE (wall.run (0.05).ok ());
  std::vector<RangeImage> images = wall.frame.images ();
  images[1].depth = images[1].depth.crop (0, 0, 10, 10);
  images[1].colour = images[1].colour.crop (0, 0, 10, 10);
  EXPECT_EQ (wall.blend.blend (images, 0.05, 1).code (), StatusCode::kBadSize);
  images.pop_back ();
  EXPECT_EQ (wall.blend.blend (images, 0.05, 1).code (), StatusCode::kBadSize);
}

/** Any sizes, depths and holes, and a rig that is not where the points say: nothing may be read or
 *  written out of bounds (under the address sanitizer). */
TEST (ColourMatch, any_images_are_survived)
{
  std::mt19937 random (5);
  for (int round = 0; round < 60; round++) {
    const int views = 1 + static_cast<int> (random () % 5);
    Rig rig;
    std::vector<std::vector<std::uint16_t>> depth;
    std::vector<std::vector<Rgbx>> colour;
    std::vector<RangeImage> images;
    for (int i = 0; i < views; i++)
      rig.views.push_back (camera_at (i, static_cast<double> (random () % 360)));
    for (int i = 0; i < views; i++) {
      const int w = static_cast<int> (random () % 40),
                h = w ? 1 + static_cast<int> (random () % 40) : 0;
      auto &d = depth.emplace_back ();
      auto &c = colour.emplace_back ();
      for (int k = 0; k < w * h; k++) {
        d.push_back (
            static_cast<std::uint16_t> (random () % 3 ? 7900 + random () % 200 : random ()));
        c.push_back (grey (static_cast<int> (random () % 256)));
      }
      images.push_back (
          {i, {static_cast<int> (random () % 100), static_cast<int> (random () % 80), w, h},
              {d.data (), w, h, w * 2}, {c.data (), w, h, w * 4}, 0});
    }
    ColourMatch match;
    const ColourSettings settings = {true, 0.001 * static_cast<double> (random () % 1000), 2};
    ASSERT_TRUE (match.set_rig (rig).ok ());
    ASSERT_TRUE (match.before (images, settings).ok ());
    for (auto &d : depth)
      for (std::uint16_t &pixel : d)
        if (random () % 4 == 0)
          pixel = 0;
    ASSERT_TRUE (match.after (images, settings).ok ());
  }
}

TEST (ColourMatch, nothing_is_allocated_once_a_frame_set_has_been_seen)
{
  Frame frame = ball (kArc, kWrong);
  const Frame fresh = frame;
  ColourMatch match;
  ASSERT_TRUE (match.set_rig (frame.rig).ok ());
  const std::vector<RangeImage> images = frame.images ();
  const ColourSettings settings = {true, 0.05, 1};
  for (int round = 0; round < 4; round++) {
    for (std::size_t i = 0; i < fresh.depth.size (); i++) {
      std::ranges::copy (fresh.depth[i], frame.depth[i].begin ());
      std::ranges::copy (fresh.colour[i], frame.colour[i].begin ());
    }
    const int before = allocations;
    ASSERT_TRUE (match.before (images, settings).ok ());
    for (std::size_t i = 0; i < frame.depth.size (); i++) /* another half each round */
      for (std::size_t k = 0; k < frame.depth[i].size (); k++)
        if ((k % kWidth < kWidth / 2) == ((i + static_cast<std::size_t> (round)) % 2 == 0))
          frame.depth[i][k] = 0;
    ASSERT_TRUE (match.after (images, settings).ok ());
    if (round > 1) {
      EXPECT_EQ (allocations - before, 0) << round;
    }
  }
}

} // namespace
} // namespace rangecast
