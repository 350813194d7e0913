/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "knownrigs.hpp"

#include <algorithm>
#include <filesystem>
#include <glib.h>
#include <rangecast/rigfile/rig_file.hpp>

namespace rangecast {

namespace fs = std::filesystem;

namespace {

bool
is_rig_file (const fs::path &path)
{
  return std::ranges::find (kRigExtensions, path.extension ().string ()) !=
         std::end (kRigExtensions);
}

/** A file itself, or the rig files of a folder in the order of their names. */
void
add_files (const fs::path &path, std::vector<std::string> &files)
{
  std::error_code error;
  std::vector<std::string> here;
  if (fs::is_directory (path, error)) {
    for (fs::directory_iterator at (path, error), end; !error && at != end; at.increment (error))
      if (is_rig_file (at->path ()) && at->is_regular_file (error))
        here.push_back (at->path ().string ());
    std::ranges::sort (here);
  } else if (fs::is_regular_file (path, error)) {
    here.push_back (path.string ());
  }
  for (auto &file : here)
    if (std::ranges::find (files, file) == files.end ())
      files.push_back (std::move (file));
}

std::array<std::string, 3>
cameras_of (const View &view)
{
  return {view.camera, view.right ? view.right->camera : "", view.third ? view.third->camera : ""};
}

/** Whether all cameras that the view names, and at least two, are there. */
bool
is_complete (const View &view, const FoundCameras &found)
{
  const auto is_there = [&] (const std::string &name) {
    return std::ranges::any_of (
        found, [&] (const FoundCamera &camera) { return camera.is_called (name); });
  };
  const auto names = cameras_of (view);
  return is_there (names[0]) && is_there (names[1]) && (names[2].empty () || is_there (names[2]));
}

std::string
display_name (const View &view, const std::string &file)
{
  const auto name = view.name.empty () ? "view " + std::to_string (view.id) : view.name;
  return "Stereo pair " + name + " of " + fs::path (file).filename ().string ();
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

const KnownRigs::RigFile &
KnownRigs::read (const std::string &path)
{
  std::error_code error;
  const auto written = fs::last_write_time (path, error);
  const auto size = fs::file_size (path, error);
  const auto at = files_.find (path);
  if (!error && at != files_.end () && at->second.written == written && at->second.size == size)
    return at->second;
  RigFile &file = files_[path];
  file = {.written = written, .size = size, .rig = {}, .problem = {}};
  reads_++;
  if (const auto status = load_rig (path, file.rig); !status.ok ())
    file.problem = status.message ();
  return file;
}

std::vector<KnownPair>
KnownRigs::pairs (const std::vector<std::string> &files, const FoundCameras &found,
    std::vector<std::string> &problems)
{
  std::erase_if (files_,
      [&] (const auto &known) { return std::ranges::find (files, known.first) == files.end (); });
  std::vector<KnownPair> pairs;
  for (const auto &path : files) {
    const RigFile &file = read (path);
    if (!file.problem.empty ()) {
      problems.push_back (file.problem);
      continue;
    }
    for (const auto &view : file.rig.views)
      if (is_complete (view, found))
        pairs.push_back ({.rig_path = path,
            .view_id = view.id,
            .cameras = cameras_of (view),
            .display_name = display_name (view, path)});
  }
  return pairs;
}

} // namespace rangecast
