/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What rangecast.wasm exports to JavaScript: functions of plain numbers, named rc_*. Records are
 * arrays of doubles in the module's memory, valid until the next call that makes the same record;
 * ../core.js names their fields. An instance is one decoder and one camera; it has one thread.
 *
 * Memory is limited to kMaxMemory (meson.build tells the linker the same). A refused allocation,
 * like any broken assumption, is a trap: the instance is then of no use, and JavaScript makes a new
 * one of the same module. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/surface/orbit.hpp>
#include <span>
#include <string>
#include <string_view>

#ifdef __wasm__
#define RC_EXPORT(name) extern "C" __attribute__ ((export_name (#name)))
#else /* a benchmark */
#define RC_EXPORT(name) extern "C"
#endif

namespace web {

inline constexpr std::size_t kMaxMemory = std::size_t{512} << 20;
/** Greatest number of views of a rig. */
inline constexpr std::size_t kMaxViews = 16;
/** Greatest width and height of a view, pixels: that of rangecast::build_strips(). */
inline constexpr int kMaxSide = 8192;
/** Greatest number of pixels in all ROIs of a frame set. Each takes about 80 bytes: decoded pixels,
 *  those that later frame sets refer to, planes and vertices. */
inline constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 22;

enum Outcome : std::int32_t {
  kDone = 0,
  kNothing = 1, ///< no frame set, but that is no error
  kEnd = 2,     ///< of the recording; rc_message() says if it is cut off
  kFailed = 3,  ///< rc_message() says why
};

/** The first bytes of what JavaScript wrote to rc_input(); empty if that has fewer. */
std::span<const std::uint8_t> input (std::uint32_t size);

/** Keeps a sentence for rc_message(). */
Outcome fail (std::string_view message);
void set_message (std::string_view message);

/** @name The decoder, for other parts of the border @{ */

/** Adds units of the access unit that comes next: rig views are used, others wait for decode(). */
void add_units (std::span<const std::uint8_t> units);
/** Decodes what was added since the last call.
 *  @param pts_ns  rangecast::kNoPts: none */
Outcome decode (std::uint64_t pts_ns);
/** Forgets earlier frame sets, after a discontinuity. */
void forget_references ();
/** Forgets the stream. */
void forget_stream ();
/** Whether a rig was complete and within the limits. */
bool has_rig ();
/** Why the last rig was refused, or the last unit could not be read; empty: nothing was. */
const std::string &refusal ();
/** Nanoseconds; 0: the stream does not say. */
std::uint64_t frame_duration_ns ();

struct FrameSet {
  std::span<const rangecast::RangeImage> images;
  const rangecast::Rig *rig;
  std::uint64_t pts_ns;
  unsigned number;     ///< changes with each frame set; 0: there is none
  unsigned rig_number; ///< changes with the rig
};
/** The last frame set that was decoded. */
FrameSet frame_set ();
/** @} */

/** What rc_scene_state() hands to rc_camera_scene() of another instance of the module: this, and
 *  then its layers and points (Vec3). */
struct SceneState {
  std::uint32_t layers, points;
  rangecast::SceneFrame home;
};
struct LayerState {
  int id, width, height;
  rangecast::Roi roi;
  rangecast::Intrinsics intrinsics;
  rangecast::Pose world_from_view;
  double depth_unit_m;
};

} // namespace web
