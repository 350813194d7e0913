/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/scene/scene.hpp>
#include <string>

#include "common/properties.hpp"

/** Property values of avatartestsrc, which may change in NULL and READY. */
struct AvatarSettings {
  static constexpr int kAllViews = -1;

  rangecast::SceneSettings scene; ///< except the size, which the caps decide
  int view_id = kAllViews;
  guint empty_frames = 0;
  guint loop_frames = 0; ///< 0: every frame is drawn
  int num_buffers = -1;  ///< frames; -1: no end
  bool is_live = false;
  std::string rig_export; ///< file; empty: none
  bool person_only = false;
};

PropertyTable<AvatarSettings> &avatar_properties ();
