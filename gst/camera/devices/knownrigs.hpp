/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

#include "foundcamera.hpp"

namespace rangecast {

/** A view of a known rig whose cameras are all there. */
struct KnownPair {
  std::string rig_path;
  int view_id = 0;
  std::array<std::string, 3> cameras; ///< left, right, third as the rig names them; third may be ""
  std::string display_name;           ///< for people

  bool operator== (const KnownPair &) const = default;
};

/** Where rig files are looked for, in this order: what RANGECAST_RIG_PATH lists (files and folders,
 *  parted by ':'), then rangecast/rigs in the user's and in the system's configuration folders
 *  (XDG). @return the files that end in .yaml, .yml or .json, each once */
std::vector<std::string> known_rig_files ();

/** What is in rig files, which are read again only when they have changed. One thread. */
class KnownRigs {
public:
  KnownRigs () = default;

  /** The pairs, among the views of these rig files, whose cameras are among `found`. Files that
   *  cannot be read are left out: `problems` then has one line for each, as load_rig() words it. */
  std::vector<KnownPair> pairs (const std::vector<std::string> &files, const FoundCameras &found,
      std::vector<std::string> &problems);

  /** How often a file was read. */
  [[nodiscard]] unsigned reads () const { return reads_; }

private:
  struct RigFile {
    std::filesystem::file_time_type written;
    std::uintmax_t size = 0;
    Rig rig;
    std::string problem; ///< empty if it could be read
  };
  const RigFile &read (const std::string &path);

  std::map<std::string, RigFile> files_;
  unsigned reads_ = 0;
};

} // namespace rangecast
