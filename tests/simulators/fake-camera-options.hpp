/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <rangecast/scene/scene.hpp>
#include <string>

#include "gige-camera.hpp"

/** Checked options of fake-cameras. */
struct FakeCameraOptions {
  rangecast::SceneSettings scene;
  GigeCameraSettings camera;               ///< the same for all, but address and serial
  std::uint32_t address_base = 0x7f000101; ///< of view0-left; the others follow
  bool third = false;
  int empty_frames = 25, loop = 0;
  std::string only;            ///< comma-separated names; empty: all
  std::string rig_export, log; ///< files to write; empty: none

  [[nodiscard]] bool serves (const std::string &name) const;
};

/** Parses the command line; prints errors to stderr.
 *  @return the exit status, or -1 to go on */
int read_fake_camera_options (int argc, char **argv, FakeCameraOptions &options);
