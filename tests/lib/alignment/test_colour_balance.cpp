/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <cmath>
#include <rangecast/alignment/colour_balance.hpp>

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
  balance.set_rig (frame.rig);
  balance.process (frame.images (), 1);
  EXPECT_LT (worst_gain (balance, kWrong), 0.01);
}

TEST (ColourBalance, colours_are_multiplied_by_the_gains)
{
  Frame frame = ball (kArc, kWrong);
  const Frame before = frame;
  ColourBalance balance;
  balance.set_rig (frame.rig);
  balance.process (frame.images (), 2);
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
  balance.set_rig (frame.rig);
  balance.process (frame.images (), 1);
  for (int id = 0; id < 4; id++)
    EXPECT_EQ (balance.gains (id), (ColourBalance::Gains{1, 1, 1}));
  for (std::size_t i = 0; i < kArc.size (); i++)
    for (std::size_t k = 0; k < frame.colour[i].size (); k++) {
      ASSERT_EQ (frame.colour[i][k].r, before.colour[i][k].r);
      ASSERT_EQ (frame.colour[i][k].g, before.colour[i][k].g);
      ASSERT_EQ (frame.colour[i][k].b, before.colour[i][k].b);
    }
}

TEST (ColourBalance, views_without_overlap_keep_their_colours)
{
  const std::vector<Rgb> wrong = {{1.2, 1.2, 1.2}, {0.8, 0.8, 0.8}};
  Frame frame = ball ({0, 180}, wrong);
  ColourBalance balance;
  balance.set_rig (frame.rig);
  balance.process (frame.images (), 1);
  for (int id : {0, 1, 7, -1, 64})
    EXPECT_EQ (balance.gains (id), (ColourBalance::Gains{1, 1, 1}));
}

TEST (ColourBalance, gains_follow_a_change_slowly_but_come_there)
{
  ColourBalance balance;
  const std::vector<Rgb> wrong = {{0.8, 0.8, 0.8}, kOne, kOne, kOne};
  const Frame right = ball (kArc, {kOne, kOne, kOne, kOne}), changed = ball (kArc, wrong);
  Frame frame = right;
  balance.set_rig (frame.rig);
  for (int i = 0; i < 60; i++) {
    frame.colour = right.colour;
    balance.process (frame.images (), 1);
  }
  float after_one = 0;
  for (int i = 0; i < 60; i++) { /* no more than before: what was long ago must not count */
    frame.colour = changed.colour;
    balance.process (frame.images (), 1);
    if (i == 0)
      after_one = balance.gains (0)[0];
  }
  EXPECT_LT (after_one, 1.05);
  EXPECT_LT (worst_gain (balance, wrong), 0.015);
  balance.reset ();
  EXPECT_EQ (balance.gains (0), (ColourBalance::Gains{1, 1, 1}));
}

} // namespace
} // namespace rangecast
