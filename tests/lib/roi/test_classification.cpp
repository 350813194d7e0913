/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Vectors against a definition pixel by pixel. */
#include "../test-support.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/roi/classification.hpp>
#include <tuple>
#include <vector>

using namespace rangecast;

namespace {

enum class Where { kUnknown, kBackground, kSomewhere, kNearer };

Where
place_of (float depth, const BackgroundPixel &b, float inferred, const ClassLimits &limits)
{
  if (depth == 0)
    return Where::kUnknown;
  if (b.depth_share < 0.05f) {
    if (inferred <= 0)
      return Where::kSomewhere;
    const float doubt =
        std::max (limits.nearness, limits.noise_factor * limits.depth_noise * inferred * inferred);
    return depth < inferred - doubt   ? Where::kSomewhere
           : depth < inferred + doubt ? Where::kBackground
                                      : Where::kUnknown;
  }
  const float sensor = limits.depth_noise * b.depth * b.depth,
              wavers = b.depth - b.nearest + limits.noise_factor * sensor;
  float noise = std::max ({limits.nearness, limits.noise_factor * sensor,
      std::min (limits.noise_factor * b.depth_spread, wavers)});
  if (b.depth_share < 0.5f)
    noise *= 2;
  return depth < b.depth - noise   ? Where::kNearer
         : depth < b.depth + noise ? Where::kBackground
                                   : Where::kUnknown;
}

struct Pixel {
  int other, nearer, same, calm, lit, blank, placed, seen;
  float ratio, tolerance;
  friend bool operator== (const Pixel &, const Pixel &) = default;
};

Pixel
classify (const BackgroundPixel &b, float inferred, float depth, Rgbx colour, const ClassLimits &l)
{
  const bool unseen = b.spread<0, burnt_out = b.mean[0]> 250 && b.mean[1] > 250 && b.mean[2] > 250;
  float distortion = 0, brightness = 0, noise = 0;
  if (!unseen && l.use_colour) {
    const float rgb[] = {colour.r + 1.f, colour.g + 1.f, colour.b + 1.f};
    float mean[3], mixed = 0, square = 0;
    for (int c = 0; c < 3; c++) {
      mean[c] = b.mean[c] * l.light[std::size_t (c)] + 1;
      if (rgb[c] > 250)
        mean[c] = std::min (mean[c], 256.f);
      mixed += rgb[c] * mean[c];
      square += mean[c] * mean[c];
    }
    brightness = mixed / square;
    for (int c = 0; c < 3; c++)
      distortion += (rgb[c] - brightness * mean[c]) * (rgb[c] - brightness * mean[c]);
    noise = std::max (b.spread, 1.5f) / std::sqrt (square);
  }
  Where where = l.use_depth ? place_of (depth, b, inferred, l) : Where::kUnknown;
  const float chroma = std::max (l.colour, l.noise_factor * b.spread),
              same = 2.5f * 1.6f * std::max (b.spread, 1.5f), tolerance = 0.08f + 2.5f * noise;
  const bool placed = where == Where::kBackground, hue = unseen || distortion > chroma * chroma,
             alike = !unseen && distortion < same * same,
             quiet = alike && std::abs (brightness - 1) < tolerance;
  const float beyond = placed ? 2 : 1, limit = l.noise_factor * noise;
  const bool light =
      brightness < l.shadow / beyond - limit || brightness > 1 + beyond * (l.highlight - 1) + limit;
  if (where == Where::kSomewhere || (where == Where::kNearer && l.doubt_depth && burnt_out))
    where = quiet && l.use_colour ? Where::kUnknown : Where::kNearer;
  const bool nearer = where == Where::kNearer;
  return {l.use_colour && (hue || light) ? 255 : 0, nearer ? 255 : 0, alike ? 255 : 0,
      nearer || (l.use_colour && !quiet) ? 0
      : placed                           ? 255
                                         : 128,
      light && !hue ? 255 : 0, burnt_out || tolerance > 0.3f ? 255 : 0, placed ? 255 : 0,
      b.depth_share >= 0.5f ? 255 : 0, brightness, tolerance};
}

constexpr int kWidth = 1000;

struct Row {
  std::vector<BackgroundPixel> background;
  std::vector<float> inferred;
  std::vector<std::uint16_t> depth;
  std::vector<Rgbx> colour;
};

/* Colours and depths at, near and far from the background's; some pixels without each. */
Row
random_row ()
{
  std::mt19937 random (11);
  const auto number = [&] (float low, float high) {
    return std::uniform_real_distribution<float> (low, high) (random);
  };
  const auto chance = [&] (float share) { return number (0, 1) < share; };
  Row row;
  for (int i = 0; i < kWidth; i++) {
    BackgroundPixel b;
    const bool white = chance (0.1f);
    for (float &level : b.mean)
      level = white ? number (248, 255) : number (0, 255);
    b.spread = chance (0.05f) ? -1 : number (0, 6);
    b.depth_share = chance (0.3f) ? 0 : number (0, 1);
    b.depth = b.depth_share > 0 ? number (4000, 20000) : 0;
    b.depth_spread = number (0, 900);
    b.nearest = b.depth * number (0.8f, 1);
    row.inferred.push_back (b.depth_share < 0.05f && chance (0.5f) ? number (4000, 20000) : 0);
    const float near = (b.depth > 0 ? b.depth : 9000) * number (0.9f, 1.1f);
    row.depth.push_back (chance (0.2f)   ? 0
                         : chance (0.3f) ? std::uint16_t (number (1, 65535))
                                         : std::uint16_t (near));
    const float light = number (0.4f, 1.6f), off = chance (0.5f) ? 3 : 90;
    const auto level = [&] (int c) {
      return std::uint8_t (std::clamp (light * b.mean[c] + number (-off, off), 0.f, 255.f));
    };
    row.colour.push_back ({level (0), level (1), level (2), 7});
    row.background.push_back (b);
  }
  return row;
}

} // namespace

TEST (Classification, vectors_equal_the_definition_bit_by_bit)
{
  const Row row = random_row ();
  for (const auto &[use_colour, use_depth, doubt_depth] :
      {std::tuple{true, true, true}, std::tuple{true, true, false}, std::tuple{true, false, false},
          std::tuple{false, true, false}}) {
    const ClassLimits limits = {
        use_colour, use_depth, doubt_depth, 4, 18, 0.5f, 1.35f, 200, 2e-6f, {1.1f, 0.9f, 1}};
    for (CpuLevel level : kCpuLevels)
      for (int n : {1, 31, 32, 45, kWidth}) {
        limit_cpu (level);
        std::vector<std::uint8_t> bytes[8];
        for (auto &b : bytes)
          b.assign (kWidth + 1, 77);
        std::vector<float> ratio (kWidth), tolerance (kWidth);
        classify_row (
            {row.background.data (), row.inferred.data (), row.depth.data (), row.colour.data ()},
            n, limits,
            {bytes[0].data (), bytes[1].data (), bytes[2].data (), bytes[3].data (),
                bytes[4].data (), bytes[5].data (), bytes[6].data (), bytes[7].data (),
                ratio.data (), tolerance.data ()});
        for (std::size_t i = 0; i < std::size_t (n); i++) {
          const Pixel expected =
              classify (row.background[i], row.inferred[i], row.depth[i], row.colour[i], limits);
          const Pixel got = {bytes[0][i], bytes[1][i], bytes[2][i], bytes[3][i], bytes[4][i],
              bytes[5][i], bytes[6][i], bytes[7][i], ratio[i], tolerance[i]};
          ASSERT_EQ (got, expected) << cpu_level_name (level) << ", pixel " << i << " of " << n;
        }
        for (const auto &b : bytes)
          ASSERT_EQ (b[std::size_t (n)], 77) << "written behind the end";
      }
  }
}

TEST (Classification, random_pixels_are_of_all_classes)
{
  const Row row = random_row ();
  const ClassLimits limits = {true, true, true, 4, 18, 0.5f, 1.35f, 200, 2e-6f, {1, 1, 1}};
  int counts[8] = {};
  for (std::size_t i = 0; i < std::size_t (kWidth); i++) {
    const Pixel p =
        classify (row.background[i], row.inferred[i], row.depth[i], row.colour[i], limits);
    int k = 0;
    for (int yes : {p.other, p.nearer, p.same, p.calm, p.lit, p.blank, p.placed, p.seen})
      counts[k++] += yes != 0;
  }
  for (int count : counts) {
    EXPECT_GT (count, 20);
    EXPECT_LT (count, kWidth - 20);
  }
}
