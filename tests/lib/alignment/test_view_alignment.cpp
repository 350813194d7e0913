/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Views of one frame set that do not agree: poses, depth, and views that are wrong altogether. */
#include <algorithm>
#include <atomic>
#include <new>
#include <rangecast/alignment/view_alignment.hpp>
#include <rangecast/scene/scene.hpp>

#include "../overlap/cylinder-support.hpp"

/* Counts what is allocated, for the test that nothing is. Not inlined, or compilers see a free that
 * has no malloc and warn. */
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

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr int kFrames = 60; ///< 4 s at 15/s

/* The built-in figure in exact depth, and the rig that saw it. */
struct Figure {
  explicit Figure (int views = 4, unsigned dress = 0, double time_s = 1)
  {
    SceneSettings settings;
    settings.views = views;
    settings.dress = dress;
    std::unique_ptr<Scene> scene;
    EXPECT_TRUE (Scene::create (settings, scene).ok ());
    rig = scene->range_rig ();
    frame = std::make_unique<Frame> (rig);
    const std::vector<RangeImage> images = frame->images ();
    std::array<Roi, kMaxViews> boxes;
    EXPECT_TRUE (
        scene->render_range (images, time_s, false, {boxes.data (), images.size ()}, 0).ok ());
  }

  Rig rig;
  std::unique_ptr<Frame> frame;
};

Mat3
turn_about (Vec3 axis, double degrees)
{
  const Vec3 a = 1 / norm (axis) * axis;
  const double s = std::sin (degrees * M_PI / 180), c = std::cos (degrees * M_PI / 180), t = 1 - c;
  return {c + t * a.x * a.x, t * a.x * a.y - s * a.z, t * a.x * a.z + s * a.y,
      t * a.x * a.y + s * a.z, c + t * a.y * a.y, t * a.y * a.z - s * a.x, t * a.x * a.z - s * a.y,
      t * a.y * a.z + s * a.x, c + t * a.z * a.z};
}

Rig
nudged (Rig rig, std::size_t view, Vec3 metres, double degrees = 0, Vec3 axis = {0, 1, 0})
{
  Pose &pose = rig.views[view].world_from_view;
  pose = {turn_about (axis, degrees) * pose.rotation, pose.translation + metres};
  return rig;
}

/* Root mean square of how far a view's points lie from their true places, metres. */
double
displacement (const Figure &truth, const Rig &rig, std::size_t view)
{
  double sum = 0, count = 0;
  const View &is = rig.views[view], &should = truth.rig.views[view];
  const ImageView<std::uint16_t> depth = truth.frame->depth[view].view ();
  for (int y = 0; y < depth.height; y += 3)
    for (int x = 0; x < depth.width; x += 3)
      if (const std::uint16_t d = depth.at (x, y)) {
        const Vec3 p = is.intrinsics.unproject (x, y, d * is.depth_unit_m);
        const double off = norm (is.world_from_view * p - should.world_from_view * p);
        sum += off * off;
        count++;
      }
  return std::sqrt (sum / count);
}

/* What 4 s of the same moment make of a rig. */
void
learn (ViewAlignment &alignment, const Figure &figure, const AlignmentSettings &settings = {},
    int frames = kFrames)
{
  for (int i = 0; i < frames; i++) {
    Frame copy = *figure.frame;
    const Status status = alignment.process (copy.images (), settings);
    ASSERT_TRUE (status.ok ()) << status.message ();
  }
}

constexpr AlignmentSettings kPosesOnly = {true, false, false, false, 1};
constexpr AlignmentSettings kPoints = {false, false, true, true, 1};

} // namespace

TEST (Poses, rig_that_is_right_stays_right_bit_by_bit)
{
  const Figure figure (4, kDressAll);
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (figure.rig).ok ());
  learn (alignment, figure, kPosesOnly, 30);
  EXPECT_EQ (encode_rig (alignment.rig ()), encode_rig (figure.rig));
  for (int id = 0; id < 4; id++)
    EXPECT_EQ (alignment.view (id).correction.size (), 0);
}

/* 3 mm each way, and 0.3 degrees, which move the figure by 4 mm. */
TEST (Poses, view_that_is_off_by_millimetres_is_put_right_within_4_s)
{
  const Figure figure;
  const std::array<Rig, 2> wrong = {
      nudged (figure.rig, 1, {0.003, 0, 0}), nudged (figure.rig, 2, {}, 0.3)};
  const std::array<std::size_t, 2> views = {1, 2};
  for (std::size_t k = 0; k < wrong.size (); k++) {
    ViewAlignment alignment;
    ASSERT_TRUE (alignment.set_rig (wrong[k]).ok ());
    learn (alignment, figure, kPosesOnly);
    const double before = displacement (figure, wrong[k], views[k]),
                 after = displacement (figure, alignment.rig (), views[k]);
    EXPECT_GT (before, 0.0025);
    EXPECT_LT (after, 0.33 * before) << k << ": " << 1000 * after << " mm left";
    for (std::size_t other = 0; other < 4; other++)
      EXPECT_LT (displacement (figure, alignment.rig (), other), 0.0013) << k << " " << other;
  }
}

TEST (Poses, no_correction_exceeds_its_bounds)
{
  const Figure figure;
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (nudged (figure.rig, 1, {0.02, 0, 0.01}, 1)).ok ());
  learn (alignment, figure, kPosesOnly);
  for (int id = 0; id < 4; id++) {
    EXPECT_LE (
        norm (alignment.view (id).correction.translation), PoseAlignment::kMaxTranslation * 1.0001);
    EXPECT_LE (
        norm (alignment.view (id).correction.rotation), PoseAlignment::kMaxRotation * 1.0001);
  }
}

/* A view whose pose is that wrong. */
TEST (Views, view_with_a_wrong_pose_is_skipped_from_the_first_frame_set_on)
{
  const Figure figure (4, kDressAll);
  for (const std::size_t bad : {0, 2}) {
    ViewAlignment alignment;
    ASSERT_TRUE (alignment.set_rig (nudged (figure.rig, bad, {0.03, 0.04, 0}, 5, {1, 1, 0})).ok ());
    Frame frame = *figure.frame;
    ASSERT_TRUE (alignment.process (frame.images (), {}).ok ());
    for (std::size_t i = 0; i < 4; i++) {
      EXPECT_EQ (alignment.view (int (i)).skipped, i == bad) << i << " of " << bad;
      EXPECT_EQ (frame.points (i) == 0, i == bad) << i << " of " << bad;
    }
  }
}

TEST (Views, view_with_another_persons_depth_is_skipped_until_that_person_goes)
{
  const Figure figure;
  Frame strange = *figure.frame;
  const ImageView<std::uint16_t> depth = strange.depth[2].view ();
  const Frame other (figure.rig, ellipsoid ({0.12, -0.1, -0.15}, {0.1, 0.2, 0.1}));
  Frame stranger = other;
  for (int y = 0; y < depth.height; y++)
    std::copy_n (stranger.depth[2].view ().row (y), depth.width, depth.row (y));
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (figure.rig).ok ());
  for (int i = 0; i < 30; i++) {
    Frame frame = strange;
    ASSERT_TRUE (alignment.process (frame.images (), {}).ok ());
    EXPECT_EQ (frame.points (2), 0u);
  }
  EXPECT_LT (alignment.view (2).consistency, 0.35);
  learn (alignment, figure, {}, 75);
  for (int id = 0; id < 4; id++)
    EXPECT_FALSE (alignment.view (id).skipped) << id;
  EXPECT_GT (alignment.view (2).consistency, 0.85);
}

TEST (Views, of_two_views_both_stay)
{
  const Figure figure (2);
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (nudged (figure.rig, 1, {0.05, 0, 0}, 5)).ok ());
  Frame frame = *figure.frame;
  ASSERT_TRUE (alignment.process (frame.images (), {}).ok ());
  for (std::size_t i = 0; i < 2; i++) {
    EXPECT_FALSE (alignment.view (int (i)).skipped);
    EXPECT_GT (frame.points (i), 1000u);
  }
}

/* A block of view 0, on the figure's face, nearer than it is; the whole figure has one colour. */
struct Floating {
  explicit Floating (Rgbx colour, double metres = 0.05, Rgbx figures = {200, 150, 120, 0})
  {
    for (const RangeImage &image : figure.frame->images ())
      for (int y = 0; y < image.depth.height; y++)
        std::fill_n (image.colour.row (y), image.depth.width, figures);
    frame = *figure.frame;
    const RangeImage image = frame.images ()[0];
    for (int y = kTop; y < kTop + kSize; y++)
      for (int x = kLeft; x < kLeft + kSize; x++) {
        EXPECT_NE (image.depth.at (x, y), 0);
        image.depth.at (x, y) -= std::uint16_t (metres / figure.rig.views[0].depth_unit_m);
        image.colour.at (x, y) = colour;
      }
    before = frame;
  }
  /* Points that went, in the block and elsewhere. */
  std::pair<int, int> cleared ()
  {
    ViewAlignment alignment;
    EXPECT_TRUE (alignment.set_rig (figure.rig).ok ());
    learn (alignment, figure, kPoints, 1); /* colours are compared when gains are known */
    EXPECT_TRUE (alignment.process (frame.images (), kPoints).ok ());
    const auto old = before.images (), now = frame.images ();
    int in = 0, out = 0;
    for (std::size_t i = 0; i < now.size (); i++)
      for (int y = 0; y < now[i].depth.height; y++)
        for (int x = 0; x < now[i].depth.width; x++)
          if (old[i].depth.at (x, y) != now[i].depth.at (x, y)) {
            EXPECT_EQ (now[i].depth.at (x, y), 0);
            const bool is_in =
                i == 0 && x >= kLeft && x < kLeft + kSize && y >= kTop && y < kTop + kSize;
            (is_in ? in : out)++;
          }
    EXPECT_EQ (alignment.contradicted_points (), std::size_t (in + out));
    return {in, out};
  }

  static constexpr int kLeft = 155, kTop = 90, kSize = 10;
  Figure figure{8};
  Frame frame = *figure.frame, before = frame;
};

TEST (Points, point_that_others_see_through_in_another_colour_goes)
{
  Floating green ({0, 255, 0, 0});
  const auto [in, out] = green.cleared ();
  EXPECT_GT (in, 0.6 * Floating::kSize * Floating::kSize);
  EXPECT_EQ (out, 0);
}

TEST (Points, points_of_the_same_colour_stay)
{
  Floating same ({220, 150, 120, 0});
  EXPECT_EQ (same.cleared (), std::pair (0, 0));
}

TEST (Alignment, any_images_are_survived)
{
  Rig rig = ring_rig (5);
  rig.views[3].world_from_view.translation = {0, 0, 0}; /* amid what the others see */
  rig.views[4].world_from_view = rig.views[0].world_from_view;
  std::mt19937 random (7);
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (rig).ok ());
  for (int round = 0; round < 60; round++) {
    Frame frame (rig);
    std::vector<RangeImage> images = frame.images ();
    for (RangeImage &image : images) {
      const int width = int (random () % 320), height = int (random () % 240);
      image.roi = {int (random () % unsigned (321 - width)),
          int (random () % unsigned (241 - height)), width, height};
      image.depth = image.depth.crop (0, 0, width, height);
      image.colour = image.colour.crop (0, 0, width, height);
      const unsigned kind = random () % 4, level = random () % 65536;
      for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
          image.depth.at (x, y) = std::uint16_t (kind == 0   ? random ()
                                                 : kind == 1 ? level
                                                 : kind == 2 ? level + random () % 30
                                                             : 0);
    }
    if (round % 3 == 0)
      images[1].roi = {}, images[1].depth = {}, images[1].colour = {};
    images.resize (random () % 6);
    ASSERT_TRUE (alignment.process (images, {.threads = 2}).ok ());
    ASSERT_TRUE (validate (alignment.rig ()).ok ());
  }
}

TEST (Alignment, unknown_views_are_refused_by_name)
{
  const Rig rig = ring_rig (2);
  Frame frame (rig);
  std::vector<RangeImage> images = frame.images ();
  images[1].view_id = 7;
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (rig).ok ());
  const Status status = alignment.process (images, {});
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("view 7"), std::string::npos);
}

TEST (Alignment, nothing_is_allocated_once_a_frame_set_has_been_seen)
{
  const Figure figure;
  ViewAlignment alignment;
  ASSERT_TRUE (alignment.set_rig (figure.rig).ok ());
  Frame frame = *figure.frame;
  const std::vector<RangeImage> images = frame.images ();
  for (int i = 0; i < 4; i++)
    ASSERT_TRUE (alignment.process (images, {}).ok ());
  const int before = allocations;
  for (int i = 0; i < 6; i++) {
    for (int y = 60; y < 60 + 10 * i; y++) /* more and more is contradicted */
      std::fill_n (images[0].colour.row (y), images[0].colour.width, Rgbx{0, 255, 0, 0});
    ASSERT_TRUE (alignment.process (images, {}).ok ());
  }
  EXPECT_EQ (allocations, before);
}
