/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A child process, and what it costs. */
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace bench {

class Process {
public:
  /** Starts a program that is looked for in PATH; its output goes to /dev/null. */
  explicit Process (const std::vector<std::string> &command);
  /** Ends it: SIGINT, and SIGKILL where that does not help within seconds. */
  ~Process ();
  Process (const Process &) = delete;
  Process &operator= (const Process &) = delete;

  [[nodiscard]] bool runs () const;
  /** CPU time of all its threads that live, ms: of the kernel for them, too. */
  [[nodiscard]] double cpu_ms () const;
  /** Resident memory, MiB. */
  [[nodiscard]] double memory_mib () const;

private:
  pid_t pid_ = -1;
};

} // namespace bench
