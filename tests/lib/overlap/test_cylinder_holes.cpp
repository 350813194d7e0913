/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* cylinderfilter opens no hole: what a frame set of exact depth draws from all round, it draws
 * without the points that go, too. */
#include <rangecast/scene/scene.hpp>

#include "../surface/strip-picture.hpp"
#include "cylinder-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr Angle kAngles[] = {{0, 0}, {20, 0}, {45, 0}, {70, 0}, {180, 0}, {-135, 0}, {-45, 0},
    {30, 20}, {150, 20}, {-60, 20}, {45, -20}, {-120, -20}};

struct Holes {
  Missing missing;
  double removed = 0; ///< share of the points
  [[nodiscard]] double inside () const { return double (missing.inside) / double (missing.drawn); }
  [[nodiscard]] double deeper () const { return double (missing.deeper) / double (missing.drawn); }
};

Holes
holes_of (const Rig &rig, const Frame &frame, const CylinderSettings &settings = {})
{
  Frame whole = frame, rest = frame;
  CylinderFilter filter;
  EXPECT_TRUE (filter.set_rig (rig).ok ());
  const CylinderResult result = run (filter, rest, settings);
  Holes holes;
  holes.removed = 1 - double (result.points_out) / double (result.points_in);
  StripPicture before (640, 480), after (640, 480);
  for (const Angle &angle : kAngles) {
    before.draw (rig, whole.images (), angle);
    after.draw (rig, rest.images (), angle);
    holes.missing.add (before, after);
  }
  return holes;
}

/* A square ribbon of no thickness, seen from both sides. */
Surface
ribbon (Vec3 centre, double turn_deg, double half_width, double half_height)
{
  const double a = turn_deg * M_PI / 180;
  const Vec3 normal{std::sin (a), 0, std::cos (a)}, along{std::cos (a), 0, -std::sin (a)};
  return [=] (Vec3 o, Vec3 d) {
    const double s = dot (centre - o, normal) / dot (d, normal);
    const Vec3 p = o + s * d - centre;
    const bool hit =
        s > 0 && std::abs (p.y) < half_height && std::abs (dot (p, along)) < half_width;
    return hit ? s : INFINITY;
  };
}

} // namespace

TEST (Holes, the_built_in_figure_has_none)
{
  for (const int views : {4, 8}) {
    SceneSettings settings;
    settings.views = views;
    std::unique_ptr<Scene> scene;
    ASSERT_TRUE (Scene::create (settings, scene).ok ());
    Frame frame (scene->range_rig ());
    const std::vector<RangeImage> images = frame.images ();
    std::array<Roi, kMaxViews> boxes;
    ASSERT_TRUE (scene->render_range (images, 1, false, {boxes.data (), images.size ()}, 0).ok ());
    const Holes holes = holes_of (scene->range_rig (), frame);
    EXPECT_LT (holes.inside (), 0.0002) << views;
    EXPECT_GT (holes.removed, views == 4 ? 0.15 : 0.45);
  }
}

/* Surfaces one behind the other, as hair before a cheek and a hand before the chest. */
TEST (Holes, hair_before_a_cheek_and_a_hand_before_the_chest_open_none)
{
  const Rig rig = ring_rig (4);
  const Surface head = ellipsoid ({0, 0.08, 0}, {0.075, 0.11, 0.09}),
                chest = ellipsoid ({0, -0.17, 0}, {0.17, 0.14, 0.1}),
                hand = ellipsoid ({-0.05, -0.12, 0.14}, {0.04, 0.05, 0.012}),
                left = ribbon ({-0.08, 0.05, 0.03}, 75, 0.03, 0.09),
                right = ribbon ({0.084, 0.05, 0.02}, -80, 0.035, 0.09),
                fringe = ribbon ({0, 0.15, 0.095}, 0, 0.05, 0.02);
  const Surface all[] = {head, chest, hand, left, right, fringe};
  const Frame frame (rig, [&] (Vec3 o, Vec3 d) {
    double nearest = INFINITY;
    for (const Surface &surface : all) {
      const double s = surface (o, d);
      nearest = s > 0 ? std::min (nearest, s) : nearest;
    }
    return nearest;
  });
  const Holes holes = holes_of (rig, frame);
  EXPECT_LT (holes.inside (), 0.0003); /* beside creases, which bands reach into a little */
  EXPECT_LT (holes.deeper (), 0.001);
  EXPECT_GT (holes.removed, 0.08);
}

/* The measure itself: were it blind, the tests above would pass whatever goes. */
TEST (Holes, a_pixel_of_a_camera_that_is_missing_shows)
{
  const Rig rig = ring_rig (2);
  Frame whole (rig, ellipsoid ({0, 0, 0}, {0.09, 0.2, 0.11}));
  Frame rest = whole;
  auto depth = rest.depth[0].view ();
  for (int v = 118; v < 122; v++)
    for (int u = 158; u < 162; u++)
      depth.at (u, v) = 0;
  StripPicture before (640, 480), after (640, 480);
  before.draw (rig, whole.images (), {0, 0});
  after.draw (rig, rest.images (), {0, 0});
  Missing missing;
  missing.add (before, after);
  EXPECT_GT (missing.drawn, 20000u);
  EXPECT_GT (missing.inside, 20u);
  EXPECT_EQ (missing.outline, 0u);
}
