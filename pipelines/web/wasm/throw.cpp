/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The module has no exceptions (-fignore-exceptions): what throws one, such as a container that
 * would be too long, traps. */
#include <cstddef>

extern "C" {
[[noreturn]] void *
__cxa_allocate_exception (std::size_t)
{
  __builtin_trap ();
}

[[noreturn]] void
__cxa_throw (void *, void *, void (*) (void *))
{
  __builtin_trap ();
}
}
