/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangemux with more streams than a buffer has memories: what is copied, and what is allocated. */
#include "../coded-check.hpp"
#include "../failing-memory.hpp"
#include "mux-check.hpp"

#include <numeric>

using namespace rangecast;
using namespace rangecast::testing;

/* What GStreamer's own memory is asked for while this lives. Whoever copies bytes maps them. */
class MemoryWatch {
public:
  MemoryWatch () : allocator_ (gst_allocator_find (GST_ALLOCATOR_SYSMEM))
  {
    mapped = allocated = 0;
    map_ = std::exchange (allocator_->mem_map, count_map);
    auto klass = GST_ALLOCATOR_GET_CLASS (allocator_);
    alloc_ = std::exchange (klass->alloc, count_alloc);
  }
  ~MemoryWatch ()
  {
    allocator_->mem_map = map_;
    GST_ALLOCATOR_GET_CLASS (allocator_)->alloc = alloc_;
    gst_object_unref (allocator_);
  }
  static inline std::atomic<gsize> mapped;  /* bytes, for reading */
  static inline std::atomic<int> allocated; /* memories */

private:
  static gpointer count_map (GstMemory *memory, gsize size, GstMapFlags flags)
  {
    if (flags & GST_MAP_READ)
      mapped += memory->size;
    return map_ (memory, size, flags);
  }
  static GstMemory *count_alloc (GstAllocator *allocator, gsize size, GstAllocationParams *params)
  {
    allocated++;
    return alloc_ (allocator, size, params);
  }
  static inline GstMemoryMapFunction map_;
  static inline decltype (GstAllocatorClass::alloc) alloc_;
  GstAllocator *allocator_;
};

/* A frame set of every stream, whose views tell themselves by a pixel and their ROI. */
static std::vector<GstBuffer *>
raw_buffers (const Mux &mux, int frame)
{
  std::vector<GstBuffer *> buffers;
  for (int view = 0; view < int (mux.in.size ()); view++) {
    buffers.push_back (
        make_frame_set (mux.one (view), GstClockTime (frame) * kFrame, {1, 2, 8 + view % 3, 12}));
    gstrange::RangeFrameMap map (buffers.back (), GST_MAP_READWRITE);
    map.views ()[0].depth.at (7, 11) = guint16 (1000 + view);
  }
  return buffers;
}

/* A slice a view; what follows its header tells the view, too. */
static std::vector<GstBuffer *>
coded_buffers (const Mux &mux, int frame)
{
  std::vector<GstBuffer *> buffers;
  for (int view = 0; view < int (mux.in.size ()); view++) {
    std::vector<guint8> bytes (kSliceHeaderSize + 100 + gsize (view), guint8 (view));
    SliceHeader header;
    header.view_id = guint8 (view);
    header.depth_bits = 12;
    header.colour_bits = 8;
    write_slice_header (header, bytes.size (), bytes.data ());
    buffers.push_back (gst_buffer_new_memdup (bytes.data (), bytes.size ()));
    gst_range_buffer_set_capture_time (buffers.back (), GstClockTime (frame) * kFrame);
    GST_BUFFER_PTS (buffers.back ()) = GstClockTime (frame) * kFrame;
  }
  return buffers;
}

static GstBuffer *
join (Mux &mux, const std::vector<GstBuffer *> &buffers)
{
  for (std::size_t i = 0; i < buffers.size (); i++)
    fail_unless_equals_int (gst_harness_push (mux.in[i], buffers[i]), GST_FLOW_OK);
  GstBuffer *output = gst_harness_pull (mux.out);
  fail_unless (output != nullptr);
  return output;
}

static constexpr int kNumbers[] = {1, 16, 17, 33, 64}; /* of streams, of one memory each */

GST_START_TEST (test_coded_views_are_right_and_no_byte_is_copied_twice)
{
  for (const int streams : kNumbers) {
    Mux mux (streams, true);
    for (int frame = 0; frame < 3; frame++) {
      const auto buffers = coded_buffers (mux, frame);
      std::vector<std::vector<guint8>> expected;
      gsize copied = 0;
      for (GstBuffer *buffer : buffers) {
        expected.push_back (bytes_of (buffer));
        copied += expected.back ().size ();
      }
      GstBuffer *output;
      {
        MemoryWatch watch;
        output = join (mux, buffers);
        if (frame > 0)
          fail_unless_equals_uint64 (watch.mapped, copied);
      }
      fail_unless_cmp (slices_of (output), ==, expected);
      gst_buffer_unref (output);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_nothing_is_allocated_for_a_frame_set_but_its_buffer)
{
  if (!memory_can_end ())
    return;
  for (const bool coded : {false, true})
    for (const int streams : {4, 64}) {
      Mux mux (streams, coded);
      const int warm_up = 4, frames = 20;
      int by_cpp = 0;
      for (int frame = 0; frame < warm_up + frames; frame++) {
        const auto buffers = coded ? coded_buffers (mux, frame) : raw_buffers (mux, frame);
        MemoryWatch watch;
        allocations_left = INT_MAX;
        gst_buffer_unref (join (mux, buffers));
        if (frame < warm_up)
          continue;
        by_cpp += INT_MAX - allocations_left;
        fail_unless (watch.allocated == 0, "%d streams, frame %d: %d", streams, frame,
            watch.allocated.load ());
      }
      fail_unless_equals_int (by_cpp, 0);
    }
}
GST_END_TEST;

static Suite *
rangemuxmany_suite ()
{
  Suite *suite = suite_create ("rangemuxmany");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_coded_views_are_right_and_no_byte_is_copied_twice);
  tcase_add_test (tc, test_nothing_is_allocated_for_a_frame_set_but_its_buffer);
  return suite;
}

GST_CHECK_MAIN (rangemuxmany);
