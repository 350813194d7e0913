/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Bytes as a file, for parsers that ask for a path: one in memory, whose name stays the same. */
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <span>
#include <string>

class MemoryFile {
public:
  explicit MemoryFile (const char *name) : descriptor_ (memfd_create (name, MFD_CLOEXEC))
  {
    if (descriptor_ < 0)
      std::abort ();
    path_ = "/proc/self/fd/" + std::to_string (descriptor_);
  }
  ~MemoryFile () { close (descriptor_); }
  MemoryFile (const MemoryFile &) = delete;
  MemoryFile &operator= (const MemoryFile &) = delete;

  [[nodiscard]] const std::string &path () const { return path_; }
  void fill (std::span<const std::uint8_t> bytes) const
  {
    if (ftruncate (descriptor_, 0) != 0 ||
        pwrite (descriptor_, bytes.data (), bytes.size (), 0) != ssize_t (bytes.size ()))
      std::abort ();
  }

private:
  int descriptor_;
  std::string path_;
};
