/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace bench {

Process::Process (const std::vector<std::string> &command)
{
  std::vector<char *> arguments;
  for (const std::string &word : command)
    arguments.push_back (const_cast<char *> (word.c_str ()));
  arguments.push_back (nullptr);
  output_ = memfd_create ("output", MFD_CLOEXEC);
  pid_ = fork ();
  if (pid_ != 0)
    return;
  setpgid (0, 0);
  dup2 (open ("/dev/null", O_RDONLY), 0);
  dup2 (output_, 1);
  dup2 (output_, 2);
  execvp (arguments[0], arguments.data ());
  _exit (127);
}

Process::~Process ()
{
  close (output_);
  if (pid_ <= 0)
    return;
  kill (-pid_, SIGINT);
  for (int i = 0; i < 300; i++) {
    if (waitpid (pid_, nullptr, WNOHANG) != 0)
      return;
    usleep (10'000);
  }
  kill (-pid_, SIGKILL);
  waitpid (pid_, nullptr, 0);
}

std::string
Process::said () const
{
  std::string text (4096, '\0');
  text.resize (std::size_t (std::max<ssize_t> (pread (output_, text.data (), text.size (), 0), 0)));
  std::istringstream lines (text);
  std::string last;
  for (std::string line; std::getline (lines, line);) {
    if (!line.empty ())
      last = line;
    if (line.find ("ERROR") != std::string::npos)
      break;
  }
  return last;
}

bool
Process::runs () const
{
  return pid_ > 0 && waitpid (pid_, nullptr, WNOHANG) == 0;
}

/* The scheduler's own count, ns: finer than the ticks of /proc/PID/stat. */
double
Process::cpu_ms () const
{
  double sum = 0;
  std::error_code error;
  const std::string tasks = "/proc/" + std::to_string (pid_) + "/task";
  for (const auto &task : std::filesystem::directory_iterator (tasks, error)) {
    std::ifstream file (task.path () / "schedstat");
    double ns = 0;
    if (file >> ns)
      sum += ns / 1e6;
  }
  return sum;
}

double
Process::memory_mib () const
{
  std::ifstream file ("/proc/" + std::to_string (pid_) + "/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * double (sysconf (_SC_PAGESIZE)) / (1 << 20);
}

} // namespace bench
