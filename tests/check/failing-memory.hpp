/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Memory that ends, for tests of what elements do then. Include in one file of a program: it
 * replaces operator new in all that the program loads. */
#pragma once

#include <atomic>
#include <climits>
#include <cstdlib>
#include <new>

namespace rangecast::testing {

/** After so many allocations by C++ there is no memory left; GLib's own are not counted. */
inline std::atomic<int> allocations_left{INT_MAX};

/** Whether allocations are counted; not so where valgrind has put its own operator new there. */
inline bool
memory_can_end ()
{
  const int before = allocations_left;
  ::operator delete (::operator new (1));
  return allocations_left.exchange (before) < before;
}

} // namespace rangecast::testing

/* Not inlined, or compilers see a free that has no malloc and warn. */
[[gnu::noinline]] void *
operator new (std::size_t size)
{
  void *memory =
      rangecast::testing::allocations_left-- > 0 ? std::malloc (size ? size : 1) : nullptr;
  if (!memory)
    throw std::bad_alloc ();
  return memory;
}
/* The standard library's calls the one above; the address sanitizer's does not. */
[[gnu::noinline]] void *
operator new (std::size_t size, const std::nothrow_t &) noexcept
{
  return rangecast::testing::allocations_left-- > 0 ? std::malloc (size ? size : 1) : nullptr;
}
[[gnu::noinline]] void
operator delete (void *memory) noexcept
{
  std::free (memory);
}
[[gnu::noinline]] void
operator delete (void *memory, std::size_t) noexcept
{
  std::free (memory);
}
