/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stands in for thread_pool.cpp where there are no threads, as in WebAssembly. */
#include "parallel.hpp"

void
rangecast_run_workers (std::size_t, void (*work) (void *, std::size_t), void *context)
{
  work (context, 0);
}
