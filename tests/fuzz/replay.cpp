/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Feeds files, and all files of folders, to a fuzz target that is linked with it: what the tests
 * run where there is no libFuzzer. Prefixes of each file come first. usage: replay FILE|FOLDER...
 */
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size);

static std::vector<std::filesystem::path>
files_of (const std::filesystem::path &path)
{
  if (!std::filesystem::is_directory (path))
    return {path};
  std::vector<std::filesystem::path> files;
  for (const auto &entry : std::filesystem::directory_iterator (path))
    if (entry.is_regular_file ())
      files.push_back (entry.path ());
  std::ranges::sort (files);
  return files;
}

/* In memory of exactly its size, so that a sanitizer sees a byte too far. */
static void
feed (const std::vector<char> &bytes, std::size_t size)
{
  const std::vector<std::uint8_t> input (
      bytes.begin (), bytes.begin () + static_cast<std::ptrdiff_t> (size));
  LLVMFuzzerTestOneInput (input.data (), size);
}

int
main (int argc, char **argv)
{
  constexpr std::size_t kPrefixes = 16;
  int inputs = 0;
  for (int i = 1; i < argc; i++)
    for (const auto &path : files_of (argv[i])) {
      std::printf ("%s\n", path.c_str ());
      std::fflush (stdout); /* says which one it was, should it crash */
      std::ifstream file (path, std::ios::binary);
      const std::vector<char> bytes (std::istreambuf_iterator<char> (file), {});
      for (std::size_t k = 1; k <= kPrefixes; k++)
        feed (bytes, bytes.size () * k / kPrefixes);
      inputs++;
    }
  std::printf ("%d inputs\n", inputs);
  return inputs == 0;
}
