/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "classification.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* Fraction of frames with valid depth from which the background's depth is known; below it, the
 * scene there is out of range. From kSteadyShare on it is reliable. */
constexpr float kKnownShare = 0.05f, kSteadyShare = 0.5f;
/* A difference counts from this number of standard deviations of the background's noise on. */
constexpr float kNoiseFactor = 4;
/* Factor on the limits of shadow and highlight where depth matches the background. */
constexpr float kConfirmed = 2;
/* A pixel matches the background within this number of standard deviations (at least kMinSpread
 * grey levels) and this fraction of its brightness. */
constexpr float kSameFactor = 2.5f, kMinSpread = 1.5f, kSameShare = 0.08f;
/* Factor for distortion, which has two degrees of freedom. */
constexpr float kChannels = 1.6f;
constexpr float kBurntOut = 250; /* grey levels */
/* Relative noise of brightness above which the background's colour is not used. */
constexpr float kVague = 0.3f;
constexpr int kYes = 255, kPerhaps = 128;

/* Pixels that are processed together. */
constexpr int kAtOnce = 32;

template <typename V>
inline V
lesser (const V &a, const V &b)
{
  return b < a ? b : a;
}

template <typename V>
inline V
greater (const V &a, const V &b)
{
  return a < b ? b : a;
}

/* The fields of BackgroundPixel of as many pixels as there are lanes. */
enum Field { kRed, kGreen, kBlue, kSpread, kDepth, kDepthSpread, kShare, kNearest, kFields };

template <typename Lanes>
inline void
load_fields (const BackgroundPixel *pixels, typename Lanes::F (&fields)[kFields])
{
  const auto from = reinterpret_cast<const float *> (pixels);
  for (int field = 0; field < kFields; field++) {
    typename Lanes::F values{};
    for (int i = 0; i < Lanes::kLanes; i++)
      values[i] = from[kFields * i + field];
    fields[field] = values;
  }
}

/* Result of comparing depth with the background's: -1 or 0 in each lane. `somewhere`: valid depth
 * where the background had none. `background` includes `behind`, and leaves out what lies `before`
 * the mean, in the noise: of a wall the smaller part, of a person before it most. */
template <typename Lanes> struct Place {
  typename Lanes::I background, before, behind, somewhere, nearer;
};

template <typename Lanes>
inline void
find_place (const typename Lanes::F &depth, const typename Lanes::F (&field)[kFields],
    const typename Lanes::F &inferred, const ClassLimits &limits, Place<Lanes> &place)
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  const I valid = depth > 0, known = field[kShare] >= kKnownShare;
  const F nearness = F{} + limits.nearness;
  const F doubt = greater (nearness, F (kNoiseFactor * limits.depth_noise * inferred * inferred));
  const I none = inferred <= 0, front = depth < inferred - doubt;
  /* Where stereo alternates between two surfaces, their distance is not noise: only depth in front
   * of the nearer one is foreground. Stereo is stable without texture, too, but its error grows
   * when a shadow adds texture. */
  const F sensor = limits.depth_noise * field[kDepth] * field[kDepth],
          wavers = field[kDepth] - field[kNearest] + kNoiseFactor * sensor,
          steady = greater (greater (nearness, F (kNoiseFactor * sensor)),
              lesser (F (kNoiseFactor * field[kDepthSpread]), wavers));
  /* Learnt from few frames: twice. */
  const F noise = field[kShare] < kSteadyShare ? steady * 2 : steady;
  const I nearer = depth < field[kDepth] - noise, farther = depth >= field[kDepth] + noise;
  place.somewhere = valid & ~known & (none | front);
  place.nearer = valid & known & nearer;
  /* Through the background nobody is seen: it has gone. */
  place.behind = valid & (field[kShare] >= kSteadyShare) & farther;
  place.background =
      place.behind | (valid & ((known & ~nearer & ~farther) | (~known & ~none & ~front)));
  place.before = depth < (known ? field[kDepth] - greater (nearness, F (noise / kNoiseFactor))
                                : inferred - nearness);
}

/* Comparison of a colour with the background's under the current light. */
template <typename Lanes> struct Comparison {
  typename Lanes::F distortion; /* chromatic, grey levels, squared */
  typename Lanes::F brightness; /* relative to the background's */
  typename Lanes::F noise;      /* standard deviation of brightness */
};

template <typename Lanes>
inline void
compare (const Rgbx *colour, const typename Lanes::F (&field)[kFields], const ClassLimits &limits,
    Comparison<Lanes> &to)
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  const I pixels = Lanes::at (reinterpret_cast<const std::int32_t *> (colour));
  F rgb[3], mean[3], mixed{}, square{};
  to.distortion = F{};
#pragma GCC unroll 3
  for (int c = 0; c < 3; c++) {
    /* Offset by one, so that black has a brightness. */
    rgb[c] = __builtin_convertvector((pixels >> 8 * c & 255) + 1, F);
    mean[c] = field[c] * limits.light[std::size_t (c)] + 1;
    /* Saturated: only a lower bound is known. */
    mean[c] = rgb[c] > kBurntOut ? lesser (mean[c], F (F{} + 256)) : mean[c];
    mixed += rgb[c] * mean[c];
    square += mean[c] * mean[c];
  }
  to.brightness = mixed / square;
#pragma GCC unroll 3
  for (int c = 0; c < 3; c++) {
    const F d = rgb[c] - to.brightness * mean[c];
    to.distortion += d * d;
  }
  Lanes::make_root (square);
  to.noise = greater (field[kSpread], F (F{} + kMinSpread)) / square;
}

/* Results of a group of pixels, in the lower byte of each number. */
struct Group {
  std::int32_t other[kAtOnce], nearer[kAtOnce], same[kAtOnce], calm[kAtOnce], lit[kAtOnce],
      blank[kAtOnce], placed[kAtOnce], seen[kAtOnce];
  float ratio[kAtOnce], tolerance[kAtOnce];
};

template <typename Lanes>
inline void
classify_lanes (
    const ClassInput &in, const float *depths, const ClassLimits &limits, int i, Group &group)
{
  using F = typename Lanes::F;
  using I = typename Lanes::I;
  F field[kFields];
  load_fields<Lanes> (in.background + i, field);
  const I use_colour = I{} - int (limits.use_colour), use_depth = I{} - int (limits.use_depth),
          unseen = field[kSpread] < 0, /* treated as a different colour */
      compared = use_colour & ~unseen;
  Place<Lanes> place;
  find_place<Lanes> (Lanes::at (depths + i), field, Lanes::at (in.inferred + i), limits, place);
  place.background &= use_depth;
  place.behind &= use_depth;
  place.somewhere &= use_depth;
  place.nearer &= use_depth;
  Comparison<Lanes> c;
  compare<Lanes> (in.colour + i, field, limits, c);
  for (F *value : {&c.distortion, &c.brightness, &c.noise})
    Lanes::keep_where (*value, compared);

  const F same = kSameFactor * kChannels * greater (field[kSpread], F (F{} + kMinSpread)),
          chroma = greater (F (F{} + limits.colour), F (kNoiseFactor * field[kSpread])),
          noise = kNoiseFactor * c.noise;
  const I alike = ~unseen & (c.distortion < same * same),
          hue = unseen | (c.distortion > chroma * chroma);
  const float over = limits.highlight - 1;
  const F lowest = (place.background ? F{} + limits.shadow / kConfirmed : F{} + limits.shadow),
          highest = (place.background ? F{} + (1 + kConfirmed * over) : F{} + (1 + over));
  const I light = (c.brightness < lowest - noise) | (c.brightness > highest + noise);
  const F tolerance = kSameShare + kSameFactor * c.noise;
  const I burnt_out =
      (field[kRed] > kBurntOut) & (field[kGreen] > kBurntOut) & (field[kBlue] > kBurntOut);
  F off = c.brightness - 1;
  Lanes::make_positive (off);
  const I quiet = alike & (off < tolerance);
  /* Stereo sometimes finds false depth without texture; colour is more reliable there. */
  const I textureless = burnt_out & (I{} - int (limits.doubt_depth)),
          doubtful = place.somewhere | (place.nearer & textureless),
          nearer = (place.nearer & ~textureless) | (doubtful & ~(quiet & use_colour));
  Lanes::at (group.other + i) = use_colour & (hue | light) & ~place.behind;
  Lanes::at (group.nearer + i) = nearer;
  Lanes::at (group.same + i) = alike;
  const I matches = place.background ? I{} + kYes : I{} + kPerhaps;
  Lanes::at (group.calm + i) = matches & ~(nearer | place.behind | (use_colour & ~quiet));
  Lanes::at (group.lit + i) = light & ~hue;
  Lanes::at (group.blank + i) = burnt_out | (tolerance > kVague);
  Lanes::at (group.placed + i) = place.background & (place.behind      ? I{} + 1
                                                        : place.before ? I{} + kPerhaps
                                                                       : I{} + kYes);
  Lanes::at (group.seen + i) = field[kShare] >= kSteadyShare;
  Lanes::at (group.ratio + i) = c.brightness;
  Lanes::at (group.tolerance + i) = tolerance;
}

/* Copies the lower bytes of the first n numbers. */
inline void
put (const std::int32_t (&from)[kAtOnce], int n, std::uint8_t *to)
{
  std::uint8_t bytes[kAtOnce];
  for (int i = 0; i < kAtOnce; i++)
    bytes[i] = static_cast<std::uint8_t> (from[i]);
  std::memcpy (to, bytes, static_cast<std::size_t> (n));
}

template <typename Lanes>
inline void
classify_group (const ClassInput &in, int n, const ClassLimits &limits, const ClassRow &to)
{
  Group group;
  float depths[kAtOnce];
  for (int i = 0; i < kAtOnce; i++)
    depths[i] = float (in.depth[i]);
  for (int i = 0; i < kAtOnce; i += Lanes::kLanes)
    classify_lanes<Lanes> (in, depths, limits, i, group);
  put (group.other, n, to.other);
  put (group.nearer, n, to.nearer);
  put (group.same, n, to.same);
  put (group.calm, n, to.calm);
  put (group.lit, n, to.lit);
  put (group.blank, n, to.blank);
  put (group.placed, n, to.placed);
  put (group.seen, n, to.seen);
  std::copy_n (group.ratio, n, to.ratio);
  std::copy_n (group.tolerance, n, to.tolerance);
}

template <typename Lanes>
inline void
classify (const ClassInput &in, int n, const ClassLimits &limits, const ClassRow &to)
{
  const auto part = [&] (int x) {
    return ClassRow{to.other + x, to.nearer + x, to.same + x, to.calm + x, to.lit + x, to.blank + x,
        to.placed + x, to.seen + x, to.ratio + x, to.tolerance + x};
  };
  int x = 0;
  for (; x + kAtOnce <= n; x += kAtOnce)
    classify_group<Lanes> ({in.background + x, in.inferred + x, in.depth + x, in.colour + x},
        kAtOnce, limits, part (x));
  if (x == n)
    return;
  BackgroundPixel background[kAtOnce] = {};
  float inferred[kAtOnce] = {};
  std::uint16_t depth[kAtOnce] = {};
  Rgbx colour[kAtOnce] = {};
  std::copy (in.background + x, in.background + n, background);
  std::copy (in.inferred + x, in.inferred + n, inferred);
  std::copy (in.depth + x, in.depth + n, depth);
  std::copy (in.colour + x, in.colour + n, colour);
  classify_group<Lanes> ({background, inferred, depth, colour}, n - x, limits, part (x));
}

/* Histogram of brightness ratios from 1/4 to 4, to find the mode. Bins are the first bits of a
 * number, which are nearly its logarithm. */
class RatioPeak {
public:
  void add (float ratio)
  {
    if (const std::uint32_t i = (std::bit_cast<std::uint32_t> (ratio) >> kShift) - kFirst;
        i < kBins)
      counts_[i]++;
    all_++;
  }
  /** @return the mode if at least a sixth of all samples share it, else the fallback */
  [[nodiscard]] float peak (float fallback) const
  {
    constexpr int kReach = 3;
    int best = 0, best_sum = 0;
    for (int i = kReach; i < kBins - kReach; i++)
      if (const int sum = std::reduce (&counts_[i - kReach], &counts_[i + kReach] + 1);
          sum > best_sum)
        best = i, best_sum = sum;
    if (best_sum == 0 || best_sum * 6 < all_)
      return fallback;
    double mean = 0;
    for (int i = best - kReach; i <= best + kReach; i++)
      mean += counts_[i] * (kFirst + i + 0.5) / best_sum;
    return std::bit_cast<float> (static_cast<std::uint32_t> (mean * (1 << kShift)));
  }

private:
  static constexpr int kBits = 5, kShift = 23 - kBits, kBins = 4 << kBits;
  static constexpr std::uint32_t kFirst = std::bit_cast<std::uint32_t> (0.25f) >> kShift;
  std::array<int, kBins> counts_{};
  int all_ = 0;
};

/* Distance of the pixels that the light is estimated from. */
constexpr int kLightStep = 4;

/* Adds the brightness ratios of every fourth pixel, at most n of them and kAtOnce. */
template <typename Lanes>
inline void
add_ratios (const ClassInput &in, int n, const ClassLimits &limits, RatioPeak (&ratios)[3])
{
  BackgroundPixel background[kAtOnce] = {};
  float inferred[kAtOnce] = {}, depth[kAtOnce] = {};
  std::int32_t in_front[kAtOnce];
  n = std::min (n, kAtOnce);
  for (int i = 0; i < n; i++) {
    background[i] = in.background[kLightStep * i];
    inferred[i] = in.inferred[kLightStep * i];
    depth[i] = limits.use_depth ? float (in.depth[kLightStep * i]) : 0;
  }
  for (int i = 0; i < kAtOnce; i += Lanes::kLanes) {
    typename Lanes::F field[kFields];
    load_fields<Lanes> (background + i, field);
    Place<Lanes> place;
    find_place<Lanes> (Lanes::at (depth + i), field, Lanes::at (inferred + i), limits, place);
    Lanes::at (in_front + i) = place.somewhere | place.nearer;
  }
  const auto usable = [] (float level) { return level >= 16 && level <= 240; };
  for (int i = 0; i < n; i++) {
    if (background[i].spread < 0 || in_front[i])
      continue;
    const Rgbx &colour = in.colour[kLightStep * i];
    const float rgb[] = {float (colour.r), float (colour.g), float (colour.b)};
    for (int c = 0; c < 3; c++)
      if (usable (background[i].mean[c]) && usable (rgb[c]))
        ratios[c].add (rgb[c] / background[i].mean[c]);
  }
}

} // namespace

void
classify_row (const ClassInput &input, int n, const ClassLimits &limits, const ClassRow &classes)
{
  for_this_cpu (
      [&]<typename Lanes> (const Lanes &) { classify<Lanes> (input, n, limits, classes); });
}

void
estimate_light (const ConstRangeImage &image, const BackgroundModel &background,
    const ClassLimits &limits, std::array<float, 3> &light)
{
  RatioPeak ratios[3];
  for_this_cpu ([&]<typename Lanes> (const Lanes &) {
    for (int y = 0; y < image.roi.height; y += kLightStep)
      for (int x = 0; x < image.roi.width; x += kLightStep * kAtOnce)
        add_ratios<Lanes> ({background.row (image.roi.y + y) + image.roi.x + x,
                               background.inferred_depth (image.roi.y + y) + image.roi.x + x,
                               image.depth.row (y) + x, image.colour.row (y) + x},
            (image.roi.width - x + kLightStep - 1) / kLightStep, limits, ratios);
  });
  for (std::size_t c = 0; c < 3; c++)
    light[c] = ratios[c].peak (light[c]);
}

} // namespace rangecast
