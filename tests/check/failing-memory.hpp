/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Memory that ends, for tests of what elements do then. Include in one file of a program: it
 * replaces operator new in all that the program loads. */
#pragma once

#include <atomic>
#include <climits>
#include <cstdlib>
#include <new>

#include "rangecast-check.hpp"

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

inline int
count_errors (GstBus *bus)
{
  int errors = 0;
  while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR)) {
    errors++;
    gst_message_unref (message);
  }
  return errors;
}

/** Gives a harness of `launch` caps and a frame set, again and again, with memory that ends after
 *  0, 1, 2 ... allocations, until there is enough. Each time but the last there must be one error
 *  message, and never a crash. @return how often there was not enough */
inline int
run_out_of_memory (const char *launch, const Rig &rig)
{
  for (int most = 0;; most++) {
    GstHarness *h = gst_harness_new_parse (launch);
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (h->element, bus);
    GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (rig, 30, 1));
    GstBuffer *buffer = make_frame_set (rig);
    allocations_left = most;
    gst_harness_set_src_caps (h, caps);
    const int left = allocations_left.exchange (INT_MAX);
    GstFlowReturn flow = GST_FLOW_ERROR;
    if (count_errors (bus) == 0) { /* else one for each time that the pad was offered the caps */
      allocations_left = left;
      flow = gst_harness_push (h, gst_buffer_ref (buffer));
      allocations_left = INT_MAX;
      fail_unless_equals_int (count_errors (bus), flow == GST_FLOW_OK ? 0 : 1);
    }
    gst_buffer_unref (buffer);
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
    if (flow == GST_FLOW_OK)
      return most;
  }
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
