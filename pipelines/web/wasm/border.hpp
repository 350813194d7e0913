/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What rangecast.wasm exports to JavaScript: the functions of rangecast.h, and those of plain
 * numbers here, named rc_*. Records are arrays of doubles in the module's memory, valid until the
 * next call that makes the same record; ../core.js names their fields. An instance is one decoder
 * and one camera; it has one thread.
 *
 * Memory is limited (meson.build). A refused allocation, like any broken assumption, is a trap: the
 * instance is then of no use, and JavaScript makes a new one of the same module. */
#pragma once

#include <capi/decoder.hpp>
#include <rangecast/surface/orbit.hpp>

#define RC_EXPORT(name) extern "C" __attribute__ ((export_name (#name)))

namespace web {

/** The first bytes of what JavaScript wrote to rc_input(); empty if that has fewer. */
std::span<const std::uint8_t> input (std::uint32_t size);

RangecastDecoder &decoder ();

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
