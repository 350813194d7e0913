/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What max_depth_error_m() says, held against pictures: no decoded depth is further off, and some
 * are nearly as far. All depth bits, colour bits, profiles. */
#include "../neighbourcode/neighbourcode-support.hpp"

using namespace rangecast;
using namespace rangecast::testing;

namespace {

constexpr int kWidth = 96, kHeight = 64;
constexpr Profile kProfiles[] = {Profile::kPlain, Profile::kPacked, Profile::kEntropy};

Rig
two_views (double near_m, double far_m)
{
  Rig rig = ring_rig (2);
  rig.views[0].near_m = near_m;
  rig.views[0].far_m = far_m;
  return rig;
}

/* Pixels each of which is about as far from another as a threshold allows, anywhere between near
 * and far, most of them at the far end, in colours that differ little. */
void
fill_with_steps (Picture &picture, const View &view, const EncoderSettings &settings, unsigned seed)
{
  DepthQuantiser q;
  ASSERT_TRUE (q.set (view, settings.depth_bits).ok ());
  std::mt19937 random (seed);
  const int last = q.codes () - 1, t = settings.depth_threshold;
  const int near = q.depth (0), far = q.depth (static_cast<std::uint16_t> (last));
  const int step = 1 + q.max_error ();
  int base = near;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const auto any = [&] (int least, int most) {
        return least + int (random () % unsigned (most - least + 1));
      };
      int depth;
      if (random () % 2) {
        depth = base = random () % 2 ? any (near, far) : any (far - (far - near) / 16, far);
      } else {
        const int code = q.code (static_cast<std::uint16_t> (base));
        const int other = std::clamp (code + (random () % 2 ? t : -t), 0, last);
        depth = std::clamp (
            q.depth (static_cast<std::uint16_t> (other)) + any (-step, step), near, far);
      }
      picture.depth.view ().at (x, y) = static_cast<std::uint16_t> (depth);
      const auto grey = static_cast<std::uint8_t> (any (100, 104));
      picture.colour.view ().at (x, y) = {grey, grey, grey, 0};
    }
}

/* The largest error of all views, metres; pixels may neither come nor go. */
double
worst_error (const Rig &rig, std::vector<Picture> &pictures, std::span<const std::uint8_t> bytes)
{
  AccessUnitDecoder decoder;
  EXPECT_TRUE (decoder.set_rig (rig).ok ());
  Decoded decoded = decode (decoder, bytes);
  EXPECT_EQ (decoded.result.bad_slices, 0u);
  EXPECT_EQ (decoded.pictures.size (), pictures.size ());
  double worst = 0;
  for (std::size_t i = 0; i < decoded.pictures.size (); i++)
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const int a = pictures[i].depth.view ().at (x, y),
                  b = decoded.pictures[i].depth.view ().at (x, y);
        EXPECT_EQ (a == 0, b == 0);
        worst = std::max (worst, std::abs (a - b) * rig.views[i].depth_unit_m);
      }
  return worst;
}

double
stated_error (const Rig &rig, const EncoderSettings &settings)
{
  AccessUnitEncoder encoder;
  EXPECT_TRUE (encoder.configure (rig, settings).ok ());
  return encoder.max_depth_error_m ();
}

std::vector<Picture>
pictures_of_steps (const Rig &rig, const EncoderSettings &settings, unsigned seed)
{
  std::vector<Picture> pictures;
  for (const View &view : rig.views)
    fill_with_steps (
        pictures.emplace_back (view.id, Roi{0, 0, kWidth, kHeight}), view, settings, seed++);
  return pictures;
}

} // namespace

TEST (DepthError, is_never_above_what_is_stated_and_comes_close)
{
  unsigned seed = 1;
  for (Profile profile : kProfiles)
    for (int depth_bits = 6; depth_bits <= 16; depth_bits++)
      for (int threshold : {0, 1, 2, 7, 30}) {
        EncoderSettings settings = {depth_bits, 8, threshold, 10, 1200, profile};
        const Rig rig = two_views (0.4, 2.0);
        auto pictures = pictures_of_steps (rig, settings, seed += 2);
        const double stated = stated_error (rig, settings);
        const double worst = worst_error (rig, pictures, encode (rig, pictures, settings));
        SCOPED_TRACE (::testing::Message () << "profile " << int (profile) << " bits " << depth_bits
                                            << " threshold " << threshold);
        EXPECT_LE (worst, stated + 1e-9);
        EXPECT_GE (worst, 0.85 * stated - 1e-4 - 1e-9);
      }
}
