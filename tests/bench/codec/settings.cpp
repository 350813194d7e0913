/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which codecs at which settings codec_bench runs. */
#include "settings.hpp"

#include <algorithm>

using namespace rangecast;

namespace bench {
namespace {

/* What is run at all thresholds below, one line each. With slices longer than a packet: only at the
 * default thresholds, to show what slices that fit cost. */
constexpr EncoderSettings kFamilies[] = {
    {.profile = Profile::kPlain},
    {.max_slice_size = 65535, .profile = Profile::kPlain},
    {.profile = Profile::kPacked},
    {.profile = Profile::kPacked, .choice = NeighbourChoice::kBest},
    {.max_slice_size = 65535, .profile = Profile::kPacked},
    {.profile = Profile::kEntropy},
    {.profile = Profile::kEntropy, .choice = NeighbourChoice::kBest},
    {.max_slice_size = 65535, .profile = Profile::kEntropy},
    {.profile = Profile::kPlain, .temporal = true},
    {.profile = Profile::kPacked, .temporal = true},
    {.profile = Profile::kEntropy, .temporal = true},
    {.profile = Profile::kEntropy, .choice = NeighbourChoice::kBest, .temporal = true},
};
constexpr double kDepthThresholdsMm[] = {0, 0.8, 1.6};
/* Of x264, for colour and for depth. */
constexpr std::pair<int, int> kRateFactors[] = {{17, 2}, {20, 2}, {20, 8}, {23, 2}, {23, 8},
    {23, 14}, {26, 2}, {26, 8}, {26, 14}, {29, 8}, {29, 14}, {29, 20}, {32, 20}};
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
  if (family.max_slice_size > EncoderSettings ().max_slice_size)
    return all;
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

std::vector<std::string>
add_peers (const Rig &rig, bool sequence, Codecs &codecs)
{
  std::vector<std::string> missing;
  const auto add = [&] (std::unique_ptr<Codec> codec, const char *name) {
    if (codec)
      codecs.push_back (std::move (codec));
    else if (std::ranges::count (missing, name) == 0)
      missing.emplace_back (name);
  };
  constexpr auto kJpeg = ColourCode::kJpeg;
  for (const bool whole : {false, true})
    for (const int q : {20, 30, 40, 50, 60, 70, 75, 80, 85, 90, 95})
      add (make_pair (DepthCode::kRvl, kJpeg, q, whole), kPeerName);
  for (const bool whole : {false, true})
    for (const int q : {20, 35, 50, 75, 90, 95})
      add (make_pair (DepthCode::kRvlZstd, kJpeg, q, whole), "RVL + zstd + JPEG (libzstd)");
  const char *png = "PNG (libpng)";
  for (const DepthCode depth : {DepthCode::kPngFast, DepthCode::kPng})
    for (const int q : {50, 75, 90})
      add (make_pair (depth, kJpeg, q, false), png);
  for (const ColourCode colour : {ColourCode::kPngFast, ColourCode::kPng})
    add (make_pair (DepthCode::kRvl, colour, 0, false), png);
  for (const ColourCode colour : {ColourCode::kPngFast, ColourCode::kPng})
    add (make_pair (DepthCode::kRvl, colour, 0, true), png);
  add (make_draco (rig), "Draco (libdraco)");
  if (sequence)
    for (const auto &[colour, depth] : kRateFactors)
      add (make_x264 (rig, colour, depth), "x264 (libavcodec)");
  return missing;
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
