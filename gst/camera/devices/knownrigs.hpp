/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "camera/aravis/camera_info.hpp"
#include "camera/settings.hpp"
#include <cstdint>
#include <filesystem>
#include <map>
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

/** The contents of rig files, which are read again only when they have changed. One thread. */
class KnownRigs {
public:
  /** The views of these rig files whose cameras are all among `found`. Files that cannot be read
   *  are left out, with one line in `problems`, the message of load_rig(). */
  std::vector<KnownPair> pairs (const std::vector<std::string> &files,
      const std::vector<CameraInfo> &found, std::vector<std::string> &problems);

  /** How often a file was read. */
  [[nodiscard]] unsigned reads () const { return reads_; }

private:
  struct RigFile {
    std::filesystem::file_time_type written;
    std::uintmax_t size = 0;
    rangecast::Rig rig;
    std::string problem; ///< empty if it could be read
  };
  const RigFile &read (const std::string &path);

  std::map<std::string, RigFile> files_;
  unsigned reads_ = 0;
};
