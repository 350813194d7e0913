/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What moves, what has changed, and where depth may be: the blocks of 8 x 8 pixels. */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <rangecast/base/cpu.hpp>
#include <rangecast/stereo/moving_blocks.hpp>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

constexpr int kWidth = 125, kHeight = 77; /* no whole blocks at the edges */
constexpr double kNoise = 2;
const cv::Rect kAll (0, 0, kWidth, kHeight);

/* Smooth texture, `shift` pixels further left. */
cv::Mat
scene (double shift = 0)
{
  cv::RNG random (3);
  cv::Mat texture (kHeight, 2 * kWidth, CV_32FC4), image;
  random.fill (texture, cv::RNG::NORMAL, 128, 500);
  cv::GaussianBlur (texture, texture, {}, 4);
  const cv::Matx23d from (1, 0, shift, 0, 1, 0);
  cv::warpAffine (texture, image, from, {kWidth, kHeight}, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP,
      cv::BORDER_REPLICATE);
  return image;
}

/* With the noise of a sensor. */
cv::Mat
shot (const cv::Mat &scene, cv::RNG &random)
{
  cv::Mat noise (scene.size (), CV_32FC4), image;
  random.fill (noise, cv::RNG::NORMAL, 0, kNoise);
  cv::Mat (scene + noise).convertTo (image, CV_8U);
  return image;
}

/* Root of the mean square, levels. */
double
difference (const cv::Mat &image, const cv::Mat &truth, const cv::Rect &part)
{
  cv::Mat exact;
  image.convertTo (exact, CV_32F);
  return cv::norm (exact (part), truth (part)) / std::sqrt (4.0 * part.area ());
}

} // namespace

TEST (StillAverage, still_scene_loses_its_noise_and_what_moves_starts_over)
{
  cv::Mat of_level[2];
  for (const CpuLevel level : {CpuLevel::kScalar, CpuLevel::kAvx2}) {
    limit_cpu (level);
    StillAverage still;
    cv::RNG random (1);
    const cv::Mat truth = scene (), first = shot (truth, random);
    EXPECT_EQ (cv::norm (still.add (first, kAll), first, cv::NORM_INF), 0);
    for (int i = 0; i < 10; i++)
      (void)still.add (shot (truth, random), kAll);
    EXPECT_LT (difference (still.add (shot (truth, random), kAll), truth, kAll), 0.45 * kNoise);
    cv::Mat moved = shot (truth, random);
    moved (cv::Rect (56, 32, 16, 16)) += cv::Scalar::all (12);
    const cv::Mat mean = still.add (moved, kAll);
    const cv::Rect around (48, 24, 32, 32), far (0, 0, 40, kHeight);
    EXPECT_EQ (cv::norm (mean (around), moved (around), cv::NORM_INF), 0);
    EXPECT_LT (difference (mean, truth, far), 0.45 * kNoise);
    mean.copyTo (of_level[int (level)]);
  }
  EXPECT_EQ (cv::norm (of_level[0], of_level[1], cv::NORM_INF), 0);
}

TEST (StillAverage, slow_drift_does_not_trail)
{
  StillAverage still;
  cv::RNG random (1);
  double with = 0, without = 0;
  for (int i = 0; i < 40; i++) {
    const cv::Mat truth = scene (0.25 * i), image = shot (truth, random),
                  mean = still.add (image, kAll);
    with += i < 10 ? 0 : difference (mean, truth, kAll);
    without += i < 10 ? 0 : difference (image, truth, kAll);
  }
  EXPECT_LT (with, 1.1 * without);
}

/* ---- where to match ---- */

namespace {

/* A grey room, in which things are drawn. */
struct Room {
  Image<Rgbx> colour{160, 96};
  Image<std::uint16_t> depth{160, 96};
  ChangedBlocks blocks;

  explicit Room (const cv::Rect &with_depth = {})
  {
    blocks.set ({160, 96});
    cv::Mat (96, 160, CV_16U, depth.view ().data, std::size_t (depth.view ().stride)) (with_depth)
        .setTo (1000);
    look ();
    EXPECT_TRUE (blocks.changed_outside ({0, 0, 16, 16})) << "nothing is known";
    EXPECT_EQ (blocks.find (whole ()), nullptr);
    blocks.set_reference ();
    blocks.learn ({0, whole (), depth.view (), colour.view (), 0});
    look ();
  }
  static Roi whole () { return {0, 0, 160, 96}; }
  [[nodiscard]] cv::Mat image ()
  {
    const auto view = colour.view ();
    return {96, 160, CV_8UC4, view.data, std::size_t (view.stride)};
  }
  void look () { blocks.update (image ()); }
  void change (const cv::Rect &part, int levels)
  {
    image () (part).setTo (cv::Scalar (0, levels, 0, 0));
    look ();
  }
  /* Pixels of a part that would be matched. */
  int matched (const cv::Rect &part)
  {
    cv::Mat mask = cv::Mat::zeros (96, 160, CV_8U);
    for (const cv::Rect &rect : *blocks.find (whole ()))
      mask (rect & cv::Rect (0, 0, 160, 96)).setTo (255);
    return cv::countNonZero (mask (part));
  }
};

constexpr Roi kRoi = {40, 24, 80, 56};

} // namespace

TEST (ChangedBlocks, two_blocks_outside_of_the_roi_are_a_change)
{
  for (const auto &[part, levels, changed] :
      {std::tuple{cv::Rect (125, 20, 30, 60), 30, true}, {cv::Rect (45, 35, 70, 40), 30, false},
          {cv::Rect (8, 8, 8, 8), 30, false}, {cv::Rect (0, 0, 160, 96), 6, false}}) {
    Room room;
    room.change (part, levels);
    EXPECT_EQ (room.blocks.changed_outside (kRoi), changed) << part << " " << levels;
    room.blocks.reset ();
    EXPECT_TRUE (room.blocks.changed_outside (kRoi));
  }
}

TEST (ChangedBlocks, depth_is_expected_where_it_was_and_one_block_around)
{
  Room room ({64, 8, 16, 32});
  EXPECT_EQ (room.matched ({56, 0, 32, 48}), 32 * 48);
  EXPECT_EQ (room.matched ({0, 0, 160, 96}), 32 * 48);
  EXPECT_EQ (Room ({64, 48, 3, 1}).matched ({0, 0, 160, 96}), 0) << "few pixels are noise";
}

TEST (ChangedBlocks, depth_is_expected_where_the_image_has_changed)
{
  Room room ({64, 48, 16, 16});
  EXPECT_EQ (room.matched ({120, 48, 8, 8}), 0);
  room.change ({120, 48, 8, 8}, 6);
  EXPECT_EQ (room.matched ({112, 40, 24, 24}), 24 * 24);
}

/* Sides of a frame that are no multiple of the blocks'. */
TEST (ChangedBlocks, blocks_at_the_edges_may_be_smaller)
{
  ChangedBlocks blocks;
  blocks.set ({kWidth, kHeight});
  cv::Mat image (kHeight, kWidth, CV_8UC4, cv::Scalar::all (100));
  blocks.update (image);
  blocks.set_reference ();
  image (cv::Rect (120, 60, 5, 17)).setTo (cv::Scalar::all (120));
  blocks.update (image);
  EXPECT_TRUE (blocks.changed_outside ({0, 0, 120, 56}));
  EXPECT_FALSE (blocks.changed_outside ({0, 0, kWidth, kHeight}));
}
