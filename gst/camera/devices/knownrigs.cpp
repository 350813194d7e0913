/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "knownrigs.hpp"

#include <algorithm>
#include <filesystem>
#include <glib.h>
#include <rangecast/rigfile/rig_file.hpp>

namespace fs = std::filesystem;

namespace {

/** A file itself, or the rig files of a folder in the order of their names. */
void
add_files (const fs::path &path, std::vector<std::string> &files)
{
  const auto &extensions = rangecast::kRigExtensions;
  std::error_code error;
  std::vector<std::string> here;
  if (fs::is_directory (path, error)) {
    for (fs::directory_iterator at (path, error), end; !error && at != end; at.increment (error))
      if (std::ranges::find (extensions, at->path ().extension ().string ()) !=
              std::end (extensions) &&
          at->is_regular_file (error))
        here.push_back (at->path ().string ());
    std::ranges::sort (here);
  } else if (fs::is_regular_file (path, error)) {
    here.push_back (path.string ());
  }
  for (auto &file : here)
    if (std::ranges::find (files, file) == files.end ())
      files.push_back (std::move (file));
}

/** Whether all cameras that a view names, and at least two, are among `found`. */
bool
is_complete (const CameraNames &names, const std::vector<CameraInfo> &found)
{
  const auto is_found = [&] (const std::string &name) {
    return std::ranges::any_of (
        found, [&] (const CameraInfo &camera) { return camera.is_called (name); });
  };
  return is_found (names[0]) && is_found (names[1]) && (names[2].empty () || is_found (names[2]));
}

} // namespace

std::vector<std::string>
known_rig_files ()
{
  std::vector<std::string> files;
  if (const gchar *listed = g_getenv ("RANGECAST_RIG_PATH")) {
    gchar **paths = g_strsplit (listed, G_SEARCHPATH_SEPARATOR_S, 0);
    for (gchar **path = paths; *path; ++path)
      add_files (*path, files);
    g_strfreev (paths);
  }
  add_files (fs::path (g_get_user_config_dir ()) / "rangecast" / "rigs", files);
  for (auto folder = g_get_system_config_dirs (); *folder; ++folder)
    add_files (fs::path (*folder) / "rangecast" / "rigs", files);
  return files;
}

std::vector<KnownPair>
find_known_pairs (const std::vector<std::string> &files, const std::vector<CameraInfo> &found,
    std::vector<std::string> &problems)
{
  std::vector<KnownPair> pairs;
  for (const auto &path : files) {
    rangecast::Rig rig;
    if (const auto status = rangecast::load_rig (path, rig); !status.ok ()) {
      problems.push_back (status.message ());
      continue;
    }
    for (const auto &view : rig.views) {
      const CameraNames names = camera_names (view);
      const auto name = view.name.empty () ? "view " + std::to_string (view.id) : view.name;
      if (is_complete (names, found))
        pairs.push_back ({.rig_path = path,
            .view_id = view.id,
            .cameras = names,
            .display_name =
                "Stereo pair " + name + " of " + fs::path (path).filename ().string ()});
    }
  }
  return pairs;
}
