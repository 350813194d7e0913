/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A child process, and what it costs. */
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace bench {

class Process {
public:
  /** Starts a program that is looked for in PATH; what it says is kept for said(). */
  explicit Process (const std::vector<std::string> &command);
  /** Ends it: SIGINT, and SIGKILL where that does not help within seconds. */
  ~Process ();
  Process (const Process &) = delete;
  Process &operator= (const Process &) = delete;

  [[nodiscard]] bool runs () const;
  /** The first error that it told of, or its last line. */
  [[nodiscard]] std::string said () const;
  /** CPU time of all its threads that live, ms: of the kernel for them, too. */
  [[nodiscard]] double cpu_ms () const;
  /** Resident memory, MiB. */
  [[nodiscard]] double memory_mib () const;

private:
  pid_t pid_ = -1;
  int output_ = -1; /* a file in memory */
};

} // namespace bench
