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

static void
check_views (GstBuffer *frame_set, int number)
{
  gstrange::RangeFrameMap map (frame_set, GST_MAP_READ);
  fail_unless_ok (map.status ());
  fail_unless_equals_int (map.views ().size (), number);
  for (const auto &view : map.views ()) {
    fail_unless_cmp (view.roi, ==, (Roi{1, 2, 8 + view.view_id % 3, 12}));
    fail_unless_equals_int (view.depth.at (7, 11), 1000 + view.view_id);
    fail_unless_equals_int (view.colour.at (3, 4).b, (3 + 2 * 4 + 40 * view.view_id) & 255);
  }
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

static gsize
bytes_in (const std::vector<GstBuffer *> &buffers, std::size_t from)
{
  gsize bytes = 0;
  for (std::size_t i = from; i < buffers.size (); i++)
    bytes += gst_buffer_get_size (buffers[i]);
  return bytes;
}

static constexpr int kNumbers[] = {1, 16, 17, 33, 64}; /* of streams, of one memory each */

/* Of those beyond 16 the last memory is for all that are too many. */
static std::size_t
first_copied (int streams)
{
  return streams <= 16 ? std::size_t (streams) : 15;
}

GST_START_TEST (test_raw_views_are_right_and_no_byte_is_copied_twice)
{
  for (const int streams : kNumbers) {
    Mux mux (streams);
    for (int frame = 0; frame < 3; frame++) {
      const auto buffers = raw_buffers (mux, frame);
      const gsize expected = bytes_in (buffers, first_copied (streams));
      GstBuffer *output;
      {
        MemoryWatch watch;
        output = join (mux, buffers);
        if (frame > 0) /* the first one comes with rigs */
          fail_unless_equals_uint64 (watch.mapped, expected);
      }
      check_views (output, streams);
      gst_buffer_unref (output);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_coded_views_are_right_and_no_byte_is_copied_twice)
{
  for (const int streams : kNumbers) {
    Mux mux (streams, true);
    for (int frame = 0; frame < 3; frame++) {
      const auto buffers = coded_buffers (mux, frame);
      std::vector<guint8> expected;
      for (GstBuffer *buffer : buffers)
        for (const guint8 byte : bytes_of (buffer))
          expected.push_back (byte);
      const gsize copied = bytes_in (buffers, first_copied (streams));
      GstBuffer *output;
      {
        MemoryWatch watch;
        output = join (mux, buffers);
        if (frame > 0)
          fail_unless_equals_uint64 (watch.mapped, copied);
      }
      fail_unless_cmp (bytes_of (output), ==, expected);
      fail_unless_equals_int (gst_buffer_n_memory (output), std::min (streams, 16));
      gst_buffer_unref (output);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_a_view_that_two_of_64_buffers_have_is_added_once)
{
  Mux mux (64);
  auto buffers = raw_buffers (mux, 0);
  for (const std::size_t view : {5, 40}) { /* one that is shared, one that is copied */
    gst_buffer_unref (buffers[view + 1]);
    buffers[view + 1] = gst_buffer_copy_deep (buffers[view]);
  }
  GstBuffer *output = join (mux, buffers);
  check_views (output, 62);
  gst_buffer_unref (output);
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

/* Memory that nobody can map, as that of a device which is gone. */
static GstMemory *
unreadable_memory ()
{
  static const GType type = g_type_register_static_simple (
      GST_TYPE_ALLOCATOR, "UnreadableAllocator", sizeof (GstAllocatorClass),
      [] (gpointer klass, gpointer) {
        GST_ALLOCATOR_CLASS (klass)->free = [] (GstAllocator *, GstMemory *m) { g_free (m); };
      },
      sizeof (GstAllocator), nullptr, GTypeFlags (0));
  auto allocator = GST_ALLOCATOR (gst_object_ref_sink (g_object_new (type, nullptr)));
  allocator->mem_type = "unreadable";
  allocator->mem_map = [] (GstMemory *, gsize, GstMapFlags) -> gpointer { return nullptr; };
  auto memory = g_new0 (GstMemory, 1);
  gst_memory_init (memory, GST_MEMORY_FLAG_NO_SHARE, allocator, nullptr, 100, 0, 0, 100);
  gst_object_unref (allocator); /* the memory has it */
  return memory;
}

GST_START_TEST (test_a_buffer_that_cannot_be_read_is_no_lack_of_memory)
{
  Mux mux (17, true);
  auto buffers = coded_buffers (mux, 0);
  gst_buffer_remove_all_memory (buffers[15]);
  gst_buffer_append_memory (buffers[15], unreadable_memory ());
  for (std::size_t i = 0; i < buffers.size (); i++)
    gst_harness_push (mux.in[i], buffers[i]);
  GstMessage *message = gst_bus_timed_pop_filtered (mux.bus, 20 * GST_SECOND, GST_MESSAGE_ERROR);
  fail_unless (message != nullptr);
  GError *error = nullptr;
  gst_message_parse_error (message, &error, nullptr);
  fail_unless (g_error_matches (error, GST_STREAM_ERROR, GST_STREAM_ERROR_DECODE), error->message);
  fail_unless (strstr (error->message, "cannot map") != nullptr, error->message);
  g_error_free (error);
  gst_message_unref (message);
  fail_unless_equals_int (count_errors (mux.bus), 0);
}
GST_END_TEST;

static Suite *
rangemuxmany_suite ()
{
  Suite *suite = suite_create ("rangemuxmany");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 180);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_raw_views_are_right_and_no_byte_is_copied_twice);
  tcase_add_test (tc, test_coded_views_are_right_and_no_byte_is_copied_twice);
  tcase_add_test (tc, test_a_view_that_two_of_64_buffers_have_is_added_once);
  tcase_add_test (tc, test_a_buffer_that_cannot_be_read_is_no_lack_of_memory);
  tcase_add_test (tc, test_nothing_is_allocated_for_a_frame_set_but_its_buffer);
  return suite;
}

GST_CHECK_MAIN (rangemuxmany);
