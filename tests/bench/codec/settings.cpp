/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which codecs at which settings codec_bench runs. */
#include "codec.hpp"

#include <algorithm>

using namespace rangecast;

namespace bench {
namespace {

/* What is run at all thresholds below, one line each. */
constexpr EncoderSettings kFamilies[] = {
    {.profile = Profile::kPlain},
    {.profile = Profile::kPacked},
    {.profile = Profile::kPacked, .choice = NeighbourChoice::kBest},
    {.profile = Profile::kEntropy},
    {.profile = Profile::kEntropy, .choice = NeighbourChoice::kBest},
    {.profile = Profile::kPacked, .temporal = true},
    {.profile = Profile::kEntropy, .temporal = true},
    {.profile = Profile::kEntropy, .choice = NeighbourChoice::kBest, .temporal = true},
};
constexpr double kDepthThresholdsMm[] = {0, 0.8, 1.6};
constexpr int kColourThresholds[] = {4, 7, 9, 11, 13, 16, 20};

/* Thresholds in codes for 16 bits, each once: where a code is a millimetre, some are the same. */
std::vector<int>
depth_thresholds (double code_mm)
{
  std::vector<int> codes;
  for (const double mm : kDepthThresholdsMm) {
    const int code = int (mm / code_mm + 0.01);
    if (std::ranges::count (codes, code) == 0)
      codes.push_back (code);
  }
  return codes;
}

std::vector<EncoderSettings>
settings_of (const EncoderSettings &family, double code_mm)
{
  std::vector<EncoderSettings> all = {family};
  EncoderSettings exact = family;
  exact.depth_bits = 16;
  for (const int depth : depth_thresholds (code_mm))
    for (const int colour : kColourThresholds) {
      all.push_back (exact);
      all.back ().depth_threshold = depth;
      all.back ().colour_threshold = colour;
    }
  exact.depth_threshold = exact.colour_threshold = 0; /* lossless, whatever the choice */
  if (family.choice == NeighbourChoice::kFirst)
    all.push_back (exact);
  return all;
}

} // namespace

void
add_peers (Codecs &codecs)
{
  for (const int q : {20, 30, 40, 50, 60, 70, 75, 80, 85, 90, 95})
    codecs.push_back (make_peer (q));
}

Status
add_profiles (const Rig &rig, bool sequence, Codecs &codecs)
{
  DepthQuantiser depth;
  if (Status s = depth.set (rig.views[0], 16); !s.ok ())
    return s;
  const double code_mm = depth.step () * rig.views[0].depth_unit_m * 1e3;
  for (const EncoderSettings &family : kFamilies) {
    if (family.temporal && !sequence)
      continue;
    for (const EncoderSettings &settings : settings_of (family, code_mm)) {
      std::unique_ptr<Codec> codec;
      if (Status s = make_neighbour_code (rig, settings, codec); !s.ok ())
        return s;
      codecs.push_back (std::move (codec));
    }
  }
  return {};
}

} // namespace bench
