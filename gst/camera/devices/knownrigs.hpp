/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "camera/aravis/types.hpp"
#include "camera/settings.hpp"
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

/** A view of a known rig whose cameras all answer. */
struct KnownPair {
  std::string rig_path;
  int view_id = 0;
  CameraNames cameras;      ///< as the rig names them
  std::string display_name; ///< for people

  bool operator== (const KnownPair &) const = default;
};

/** Rig files in this order: what RANGECAST_RIG_PATH lists (files and folders, separated by ':'),
 *  then rangecast/rigs in the user's and in the system's configuration folders (XDG).
 *  @return the files that end in .yaml, .yml or .json, each once */
std::vector<std::string> known_rig_files ();

/** The views of these rig files whose cameras are all among `found`. Files that cannot be read are
 *  skipped, with one line in `problems`, the message of load_rig(). */
std::vector<KnownPair> find_known_pairs (const std::vector<std::string> &files,
    const std::vector<CameraInfo> &found, std::vector<std::string> &problems);
