/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "output_path.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace rangecast {

namespace fs = std::filesystem;

Status
check_extension (const std::string &path, std::span<const std::string_view> extensions)
{
  if (std::ranges::any_of (extensions, [&] (std::string_view e) { return path.ends_with (e); }))
    return {};
  std::string list;
  for (std::size_t i = 0; i < extensions.size (); i++)
    list += (i == 0                          ? ""
                : i + 1 < extensions.size () ? ", "
                                             : " or ") +
            std::string (extensions[i]);
  return {StatusCode::kBadValue, path + ": cannot be written; use a name that ends in " + list};
}

Status
check_output_path (const std::string &path, std::span<const std::string_view> extensions)
{
  if (Status s = check_extension (path, extensions); !s.ok ())
    return s;
  std::error_code error;
  const fs::file_status there = fs::status (path, error);
  if (fs::is_directory (there))
    return {StatusCode::kBadValue, path + ": is a folder"};
  if (fs::exists (there) && !fs::is_regular_file (there))
    return {}; /* to open a pipe would wait for its reader */
  const fs::path folder = fs::path (path).parent_path ();
  if (!folder.empty () && !fs::is_directory (folder, error))
    return {StatusCode::kNotFound, path + ": its folder does not exist"};
  if (!std::ofstream (path, std::ios::binary | std::ios::app))
    return {StatusCode::kNotFound, path + ": cannot be opened for writing"};
  if (!fs::exists (there))
    fs::remove (fs::canonical (path, error), error); /* what a link leads to, not the link */
  return {};
}

} // namespace rangecast
