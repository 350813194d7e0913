/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A program ends at a signal or its time limit even if an element blocks a state change, an event
 * or the main loop. */
#pragma once

#include <glib-unix.h>
#include <sys/time.h>
#include <unistd.h>

#include <csignal>

constexpr long kPatience_ms = 1800; /* from a signal or time limit to the end of the process */

/** Ends the process with status 1 after that time; another call replaces the time. Any thread,
 *  signal handlers too. */
inline void
end_process_after (long milliseconds)
{
  const auto end = [] (int) {
    constexpr char kText[] = "ERROR: an element blocks the pipeline: the program ends without "
                             "stopping it, and files may be incomplete\n";
    [[maybe_unused]] const auto written = write (STDERR_FILENO, kText, sizeof kText - 1);
    _exit (1);
  };
  std::signal (SIGALRM, end);
  const itimerval timer{{}, {milliseconds / 1000, milliseconds % 1000 * 1000}};
  setitimer (ITIMER_REAL, &timer, nullptr);
}

/** Calls a function in the main loop at SIGINT and SIGTERM, and ends the process kPatience_ms after
 *  them. */
inline void
add_final_signals (GSourceFunc function, gpointer data)
{
  static void (*wake_main_loop) (int) = nullptr; /* GLib's handler */
  for (const int number : {SIGINT, SIGTERM}) {
    g_unix_signal_add (number, function, data);
    struct sigaction action;
    sigaction (number, nullptr, &action);
    wake_main_loop = action.sa_handler;
    action.sa_handler = [] (int signal) {
      end_process_after (kPatience_ms);
      wake_main_loop (signal);
    };
    sigaction (number, &action, nullptr);
  }
}
