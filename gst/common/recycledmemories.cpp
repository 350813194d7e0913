/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "recycledmemories.hpp"

#include <algorithm>
#include <utility>

namespace {

/* A few are downstream, in queues; more than that are freed after use. */
constexpr std::size_t kMaxKept = 16;
/* A free memory that is so many times as large as what is needed is freed: one huge frame set does
 * not hold its memory forever. Those of up to kMinExcess bytes may stay. */
constexpr gsize kMaxExcess = 8, kMinExcess = gsize{1} << 20;

/* gst_allocator_alloc() aborts where memory is short. */
GstMemory *
try_memory (gsize size)
{
  /* Half as much again, because sizes change with what the views show. */
  const gsize room = std::max<gsize> (size + size / 2, 1);
  gpointer data = g_try_malloc (room);
  return data ? gst_memory_new_wrapped (GstMemoryFlags (0), data, room, 0, size, data, g_free)
              : nullptr;
}

} // namespace

GstMemory *
RecycledMemories::acquire (gsize size)
{
  GstMemory **replaced = nullptr; /* a free one that is too small */
  std::erase_if (memories_, [size] (GstMemory *kept) {
    const bool drops = GST_MINI_OBJECT_REFCOUNT_VALUE (kept) == 1 && kept->maxsize > kMinExcess &&
                       kept->maxsize / kMaxExcess > size;
    if (drops)
      gst_memory_unref (kept);
    return drops;
  });
  for (GstMemory *&kept : memories_) {
    if (GST_MINI_OBJECT_REFCOUNT_VALUE (kept) > 1)
      continue;
    if (kept->maxsize >= size) {
      gst_memory_resize (kept, -gssize (kept->offset), size);
      return gst_memory_ref (kept);
    }
    replaced = &kept;
  }
  GstMemory *memory = try_memory (size);
  if (!memory)
    return nullptr;
  if (replaced)
    gst_memory_unref (std::exchange (*replaced, gst_memory_ref (memory)));
  else if (memories_.size () < kMaxKept)
    memories_.push_back (gst_memory_ref (memory));
  return memory;
}

void
RecycledMemories::drop ()
{
  for (GstMemory *memory : memories_)
    gst_memory_unref (memory);
  memories_.clear ();
}
