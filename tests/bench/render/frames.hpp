/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/overlap/cylinder_filter.hpp>
#include <rangecast/scene/scene.hpp>
#include <vector>

namespace bench {

/** When in the scene's motion everything is looked at, seconds. */
inline constexpr double kMoment = 0.5;

/** Range images of all views, and the memory behind them: move it, do not copy it. */
struct FrameSet {
  rangecast::Rig rig;
  std::vector<std::vector<std::uint16_t>> depth;
  std::vector<std::vector<rangecast::Rgbx>> colour;
  std::vector<rangecast::RangeImage> images; ///< cut to the figure

  FrameSet () = default;
  FrameSet (FrameSet &&) = default;
  FrameSet &operator= (FrameSet &&) = default;
};

/** The scene's own range images: exact depth, no sensor noise. */
rangecast::Status exact_frames (
    rangecast::SceneSettings settings, FrameSet &set, double time_s = kMoment);

/** The scene's stereo pairs with sensor noise, matched, freed of the background that was learnt
 *  before, and through the neighbour code with its defaults: one moment after the other. */
class Film {
public:
  Film ();
  ~Film ();
  /** @param with_third  cameras are triples, see ThirdPair */
  rangecast::Status start (const rangecast::SceneSettings &settings, bool with_third = false);
  /** @param time_s  kMoment or later */
  rangecast::Status next (double time_s, FrameSet &set);

private:
  struct Hosts;
  std::unique_ptr<Hosts> hosts_;
};

/** The first of a film, through the cylinder. */
rangecast::Status stereo_frames (const rangecast::SceneSettings &settings,
    const rangecast::CylinderSettings &cylinder, FrameSet &set);

/** Codes and decodes, which leaves runs of equal pixels. */
rangecast::Status code (FrameSet &set, const rangecast::EncoderSettings &settings);

/** Adds noise to all valid depths: independent normal numbers, smoothed over 2 pixels and scaled to
 *  the deviation wanted. */
void add_smooth_noise (FrameSet &set, double deviation_m);

} // namespace bench
