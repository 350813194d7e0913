/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Bytes right before memory that nobody may read: who reads too far crashes, libraries without
 * sanitizers included. */
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

class GuardedBytes {
public:
  /** @param pages  of memory: so much there is room for */
  explicit GuardedBytes (std::size_t pages = 1)
      : page_ (std::size_t (sysconf (_SC_PAGESIZE))), room_ (pages * page_)
  {
    void *memory =
        mmap (nullptr, room_ + page_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
      std::abort ();
    memory_ = static_cast<std::uint8_t *> (memory);
    if (mprotect (memory_ + room_, page_, PROT_NONE) != 0)
      std::abort ();
  }
  ~GuardedBytes () { munmap (memory_, room_ + page_); }
  GuardedBytes (const GuardedBytes &) = delete;
  GuardedBytes &operator= (const GuardedBytes &) = delete;

  /** A copy; of too many bytes, of the first ones. Valid until the next call. */
  std::span<std::uint8_t> copy (std::span<const std::uint8_t> bytes)
  {
    bytes = bytes.first (std::min (bytes.size (), room_));
    std::uint8_t *to = memory_ + room_ - bytes.size ();
    std::copy (bytes.begin (), bytes.end (), to);
    return {to, bytes.size ()};
  }

private:
  std::size_t page_, room_;
  std::uint8_t *memory_ = nullptr;
};
