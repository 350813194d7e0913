/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <dlfcn.h>

#include <rangecast/base/parallel.hpp>

#include "../rangecast-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_caps_carry_the_rig_and_come_back_equal)
{
  const auto info = gstrange::make_info (ring_rig (4), 30, 1);
  GstCaps *caps = gstrange::make_range_caps (info);
  gstrange::RangeInfo parsed;
  fail_unless_ok (gstrange::parse_caps (caps, parsed));
  fail_unless_equals_int (parsed.width, 320);
  fail_unless_equals_int (parsed.views (), 4);
  fail_unless_equals_uint64 (parsed.frame_duration (), GST_SECOND / 30);
  fail_unless_cmp (encode_rig (parsed.rig), ==, encode_rig (info.rig));
  GstCaps *filter = gst_caps_from_string (GST_RANGE_CAPS);
  fail_unless (gst_caps_is_subset (caps, filter));
  gst_caps_unref (filter);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_bad_caps_are_refused_by_field)
{
  gstrange::RangeInfo parsed;
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (2), 30, 1));
  gst_caps_set_simple (caps, "views", G_TYPE_INT, 3, nullptr);
  fail_unless_contains (gstrange::parse_caps (caps, parsed).message (), "views=3");
  gst_caps_set_simple (caps, "views", G_TYPE_INT, 2, "width", G_TYPE_INT, 100, nullptr);
  fail_unless_contains (gstrange::parse_caps (caps, parsed).message (), "larger");
  gst_structure_remove_field (gst_caps_get_structure (caps, 0), "rig");
  fail_unless_contains (gstrange::parse_caps (caps, parsed).message (), "rig");
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_application_reads_camera_from_caps)
{
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (4), 30, 1));
  GstRangeCamera camera;
  fail_unless (gst_range_caps_get_camera (caps, 1, &camera));
  fail_unless_equals_float (camera.fx, 320);
  fail_unless_cmp (std::abs (camera.world_from_view[3] - 0.8), <, 1e-9);
  fail_if (gst_range_caps_get_camera (caps, 4, &camera));
  fail_if (gst_range_caps_get_camera (caps, 4000000000u, &camera));
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_caps_of_cameras_give_the_same_cameras)
{
  GstRangeCamera cameras[2], read;
  const gdouble pose[12] = {0, 0, -1, 1, 0, -1, 0, 2, -1, 0, 0, 3};
  gst_range_camera_init (&cameras[0], 63, 320, 240, 300);
  gst_range_camera_init (&cameras[1], 0, 640, 200, 500);
  gst_range_camera_set_pose (&cameras[1], pose);
  cameras[1].depth_unit = 0.001;
  GError *error = nullptr;
  GstCaps *caps = gst_range_caps_new (cameras, 2, 30, 1, &error);
  g_assert_no_error (error);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  fail_unless_equals_int (info.width, 640);
  fail_unless_equals_int (info.height, 240);
  fail_unless_equals_uint64 (gst_range_caps_get_view_ids (caps), (guint64{1} << 63) + 1);
  for (const GstRangeCamera &camera : cameras) {
    GstRangeCamera *copy = gst_range_camera_copy (&camera);
    fail_unless (gst_range_caps_get_camera (caps, camera.view_id, &read));
    fail_unless_equals_int (read.width, copy->width);
    fail_unless_equals_float (read.fx, copy->fx);
    fail_unless_equals_float (read.cy, copy->cy);
    fail_unless_equals_float (read.depth_unit, copy->depth_unit);
    for (int i = 0; i < 12; i++)
      fail_unless_equals_float (read.world_from_view[i], copy->world_from_view[i]);
    gst_range_camera_free (copy);
  }
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_cameras_out_of_range_are_an_error)
{
  GstRangeCamera good, bad;
  gst_range_camera_init (&good, 0, 320, 240, 300);
  auto refused = [] (const GstRangeCamera *cameras, guint n, gint fps_n, const char *text) {
    GError *error = nullptr;
    fail_if (gst_range_caps_new (cameras, n, fps_n, 1, &error));
    g_assert_error (error, GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_SETTINGS);
    fail_unless_contains (std::string (error->message), text);
    g_error_free (error);
    fail_if (gst_range_caps_new (cameras, n, fps_n, 1, nullptr));
  };
  refused (&good, 0, 30, "at least one camera");
  refused (&good, 1, -1, "frame rate");
  const GstRangeCamera twice[] = {good, good};
  refused (twice, 2, 30, "twice");
  for (const guint id : {64u, G_MAXUINT}) {
    gst_range_camera_init (&bad, id, 320, 240, 300);
    refused (&bad, 1, 30, "must be 0 to 63");
  }
  bad = good;
  bad.world_from_view[0] = 2;
  refused (&bad, 1, 30, "rotation");
  bad = good;
  bad.min_depth = 0;
  refused (&bad, 1, 30, "near");
  gst_range_camera_init (&bad, 0, 0, G_MAXINT, 300);
  refused (&bad, 1, 30, "image size");
  GstCaps *none = gst_caps_new_empty_simple ("video/x-raw");
  fail_unless_equals_uint64 (gst_range_caps_get_view_ids (none), 0);
  gst_caps_unref (none);
}
GST_END_TEST;

GST_START_TEST (test_append_shares_memory_and_shifts_offsets)
{
  Rig all = ring_rig (2), first, second;
  first.views = {all.views[0]};
  second.views = {all.views[1]};
  GstBuffer *a = make_frame_set (first, 5), *b = make_frame_set (second, 5, {10, 20, 33, 17});
  fail_unless (gst_range_buffer_append (a, b));
  fail_unless_equals_int (gst_buffer_n_range_metas (a), 2);
  ck_assert_ptr_eq (gst_buffer_peek_memory (a, 1), gst_buffer_peek_memory (b, 0));
  {
    gstrange::RangeFrameMap frame (a, GST_MAP_READ), part (b, GST_MAP_READ);
    ck_assert_ptr_eq (frame.views ()[1].depth.data, part.views ()[0].depth.data);
    ck_assert_ptr_eq (frame.views ()[1].colour.data, part.views ()[0].colour.data);
    fail_unless_cmp (frame.views ()[1].roi, ==, (Roi{10, 20, 33, 17}));
  }
  gst_buffer_unref (b);
  gst_buffer_unref (a);
}
GST_END_TEST;

GST_START_TEST (test_append_refuses_the_same_view_twice)
{
  const Rig rig = ring_rig (1);
  GstBuffer *a = make_frame_set (rig), *b = make_frame_set (rig);
  fail_if (gst_range_buffer_append (a, b));
  fail_unless_equals_int (gst_buffer_n_range_metas (a), 1);
  gst_buffer_unref (a);
  gst_buffer_unref (b);
}
GST_END_TEST;

GST_START_TEST (test_merged_memory_keeps_the_views_where_they_are)
{
  GstBuffer *buffer = make_frame_set (ring_rig (3));
  GstMapInfo map;
  fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
  GstBuffer *merged = gst_buffer_new_memdup (map.data, map.size);
  gst_buffer_unmap (buffer, &map);
  gpointer state = nullptr;
  while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state)) {
    auto copy = reinterpret_cast<GstRangeMeta *> (
        gst_buffer_add_meta (merged, GST_RANGE_META_INFO, nullptr));
    const GstMeta base = copy->meta;
    *copy = *meta;
    copy->meta = base;
  }
  {
    gstrange::RangeFrameMap a (buffer, GST_MAP_READ), b (merged, GST_MAP_READ);
    fail_unless_equals_int (b.views ().size (), 3);
    for (int i = 0; i < 3; i++)
      fail_unless_equals_int (a.views ()[i].depth.at (160, 120), b.views ()[i].depth.at (160, 120));
  }
  gst_buffer_unref (buffer);
  gst_buffer_unref (merged);
}
GST_END_TEST;

GST_START_TEST (test_metas_that_point_outside_are_refused)
{
  GstBuffer *buffer = make_frame_set (ring_rig (2));
  GstRangeMeta *meta = gst_buffer_get_range_meta (buffer, 1);
  const GstRangeMeta good = *meta;
  auto refused = [&] {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
    const bool bad = !frame.status ().ok () && frame.views ().empty ();
    *meta = good;
    return bad;
  };
  meta->depth_offset += 2 * 320 * 240 * 4;
  fail_unless (refused ());
  meta->depth_offset = G_MAXSIZE - 1;
  fail_unless (refused ());
  meta->colour_stride += 2; /* not whole pixels */
  fail_unless (refused ());
  meta->colour_stride = 4;
  fail_unless (refused ());
  meta->height = 100000;
  fail_unless (refused ());
  meta->depth_offset += 1;
  fail_unless (refused ());
  meta->view_id = 64;
  fail_unless (refused ());
  fail_if (refused ());
  gst_buffer_unref (buffer);
}
GST_END_TEST;

GST_START_TEST (test_copies_of_whole_buffers_keep_views_and_regions_lose_them)
{
  GstBuffer *buffer = make_frame_set (ring_rig (2), 42);
  GstBuffer *copy = gst_buffer_copy (buffer);
  fail_unless_equals_int (gst_buffer_n_range_metas (copy), 2);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (copy), 42);
  GstBuffer *region = gst_buffer_copy_region (buffer, GST_BUFFER_COPY_ALL, 10, 100);
  fail_unless_equals_int (gst_buffer_n_range_metas (region), 0);
  gst_buffer_unref (region);
  gst_buffer_unref (copy);
  gst_buffer_unref (buffer);
}
GST_END_TEST;

GST_START_TEST (test_crop_moves_the_planes_without_touching_pixels)
{
  GstBuffer *buffer = make_frame_set (ring_rig (1));
  guint16 expected;
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    expected = frame.views ()[0].depth.at (150, 110);
    frame.crop (0, {140, 100, 50, 40});
    fail_unless_equals_int (frame.views ()[0].depth.at (10, 10), expected);
  }
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    fail_unless_cmp (frame.views ()[0].roi, ==, (Roi{140, 100, 50, 40}));
    fail_unless_equals_int (frame.views ()[0].depth.at (10, 10), expected);
    fail_unless_equals_int (frame.views ()[0].colour.at (10, 10).r, 150);
    frame.crop (0, {});
  }
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
    fail_unless_ok (frame.status ());
    fail_unless (frame.views ()[0].roi.empty ());
  }
  gst_buffer_unref (buffer);
}
GST_END_TEST;

GST_START_TEST (test_pool_recycles_buffers_with_any_roi)
{
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (2), 30, 1));
  GstBufferPool *pool = gst_range_buffer_pool_new ();
  fail_unless (gst_range_buffer_pool_configure (pool, caps, 1, 1));
  fail_unless (gst_buffer_pool_set_active (pool, TRUE));
  GstMemory *memory = nullptr;
  for (guint side = 0; side <= 240; side += 80) {
    GstBuffer *buffer = nullptr;
    fail_unless_equals_int (gst_buffer_pool_acquire_buffer (pool, &buffer, nullptr), GST_FLOW_OK);
    fail_unless (!memory || memory == gst_buffer_peek_memory (buffer, 0));
    memory = gst_buffer_peek_memory (buffer, 0);
    fail_unless_equals_int (gst_buffer_n_range_metas (buffer), 0);
    for (guint id = 0; id < 2; id++)
      fail_unless (gst_range_buffer_add_view (buffer, id, 0, 0, side, side, 7));
    fail_if (gst_range_buffer_add_view (buffer, 2, 0, 0, 1, 1, 7));
    {
      gstrange::RangeFrameMap frame (buffer, GST_MAP_WRITE);
      fail_unless_equals_int (frame.views ().size (), 2);
      for (const auto &view : frame.views ())
        if (side)
          view.depth.at (side - 1, side - 1) = 1;
    }
    gst_buffer_unref (buffer);
  }
  gst_buffer_pool_set_active (pool, FALSE);
  gst_object_unref (pool);
  gst_caps_unref (caps);
}
GST_END_TEST;

/* Marks each view's corners in both planes, then finds them all: no view lies on another. */
static void
check_that_views_are_apart (GstBuffer *buffer, std::size_t views)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  fail_unless_equals_int (frame.views ().size (), views);
  for (const auto &view : frame.views ()) {
    if (view.roi.empty ())
      continue;
    const int right = view.roi.width - 1, bottom = view.roi.height - 1;
    view.depth.at (0, 0) = view.depth.at (right, bottom) = guint16 (1000 + view.view_id);
    view.colour.at (0, 0).r = view.colour.at (right, bottom).r = guint8 (view.view_id);
  }
  for (const auto &view : frame.views ()) {
    if (view.roi.empty ())
      continue;
    const int right = view.roi.width - 1, bottom = view.roi.height - 1;
    fail_unless_equals_int (view.depth.at (right, bottom), 1000 + view.view_id);
    fail_unless_equals_int (view.depth.at (0, 0), 1000 + view.view_id);
    fail_unless_equals_int (view.colour.at (right, bottom).r, view.view_id);
    fail_unless_equals_int (view.colour.at (0, 0).r, view.view_id);
  }
}

GST_START_TEST (test_pool_recycles_buffers_of_up_to_64_views_with_other_rois)
{
  for (const int views : {16, 17, 64}) {
    GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (views), 30, 1));
    GstBufferPool *pool = gst_range_buffer_pool_new ();
    fail_unless (gst_range_buffer_pool_configure (pool, caps, 1, 1));
    fail_unless (gst_buffer_pool_set_active (pool, TRUE));
    GstMemory *memory = nullptr;
    for (const guint side : {240u, 80u, 0u, 160u, 240u}) {
      GstBuffer *buffer = nullptr;
      fail_unless_equals_int (gst_buffer_pool_acquire_buffer (pool, &buffer, nullptr), GST_FLOW_OK);
      fail_unless_equals_int (gst_buffer_n_memory (buffer), views > 16 ? 1 : views);
      fail_unless (!memory || memory == gst_buffer_peek_memory (buffer, 0));
      memory = gst_buffer_peek_memory (buffer, 0);
      for (guint id = 0; id < guint (views); id++)
        fail_unless (gst_range_buffer_add_view (buffer, id, 0, 0, side, side, 7));
      fail_if (gst_range_buffer_add_view (buffer, 0, 0, 0, 0, 0, 7));
      check_that_views_are_apart (buffer, std::size_t (views));
      gst_buffer_unref (buffer);
    }
    gst_buffer_pool_set_active (pool, FALSE);
    gst_object_unref (pool);
    gst_caps_unref (caps);
  }
}
GST_END_TEST;

GST_START_TEST (test_views_of_64_buffers_are_where_they_were_after_append)
{
  const Rig rig = ring_rig (64, 33, 24);
  GstBuffer *all = gst_buffer_new ();
  for (const View &view : rig.views) {
    GstBuffer *one = make_frame_set ({{view}}, 5, {1, 2, 3 + view.id % 5, 4 + view.id % 7});
    {
      gstrange::RangeFrameMap frame (one, GST_MAP_READWRITE);
      frame.views ()[0].depth.at (2, 3) = guint16 (1000 + view.id);
    }
    fail_unless (gst_range_buffer_append (all, one));
    gst_buffer_unref (one);
  }
  {
    gstrange::RangeFrameMap frame (all, GST_MAP_READ);
    fail_unless_equals_int (frame.views ().size (), 64);
    for (const auto &view : frame.views ())
      fail_unless_equals_int (view.depth.at (2, 3), 1000 + view.view_id);
  }
  gst_buffer_unref (all);
}
GST_END_TEST;

/* By rangemux, or rangedemux. */
GST_START_TEST (test_a_pool_gets_memories_back_that_went_into_another_buffer)
{
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (2, 32, 24), 30, 1));
  GstBufferPool *pool = gst_range_buffer_pool_new ();
  fail_unless (gst_range_buffer_pool_configure (pool, caps, 0, 0));
  fail_unless (gst_buffer_pool_set_active (pool, TRUE));
  GstMemory *first = nullptr;
  for (int i = 0; i < 5; i++) {
    GstBuffer *buffer = nullptr, *other = gst_buffer_new ();
    fail_unless_equals_int (gst_buffer_pool_acquire_buffer (pool, &buffer, nullptr), GST_FLOW_OK);
    const GstRangeMeta *meta = gst_range_buffer_add_view (buffer, 1, 0, 0, 32, 24, 7);
    fail_unless (meta && gst_range_buffer_add_view (buffer, 0, 0, 0, 16, 24, 7));
    first = first ? first : gst_buffer_peek_memory (buffer, 0);
    ck_assert_ptr_eq (gst_buffer_peek_memory (buffer, 0), first);
    if (i % 2) {
      gst_buffer_unref (other);
      other = gst_range_buffer_copy_view (buffer, meta);
    } else {
      fail_unless (gst_range_buffer_append (other, buffer));
    }
    gst_buffer_unref (buffer);
    gst_buffer_unref (other);
  }
  gst_buffer_pool_set_active (pool, FALSE);
  gst_object_unref (pool);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_view_larger_than_the_caps_is_refused)
{
  for (const guint views : {1u, 64u}) {
    GstBuffer *buffer = gst_range_buffer_new (views, 32, 24);
    fail_if (gst_range_buffer_add_view (buffer, 0, 0, 0, 16384, 16384, 0));
    fail_if (gst_range_buffer_add_view (buffer, 0, 0, 0, G_MAXUINT, G_MAXUINT, 0));
    fail_unless (gst_range_buffer_add_view (buffer, 0, 0, 0, 32, 24, 0));
    gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

GST_START_TEST (test_frame_set_beyond_the_limit_is_refused)
{
  fail_if (gst_range_buffer_new (64, 16384, 16384));
  fail_if (gst_range_buffer_new (65, 16, 16));
  fail_if (gst_range_buffer_new (1, G_MAXUINT, G_MAXUINT));
  GstCaps *caps = gst_caps_from_string (
      "video/x-range,format=Z16_RGBx,width=16384,height=16384,views=64,framerate=30/1");
  GstBufferPool *pool = gst_range_buffer_pool_new ();
  fail_if (gst_range_buffer_pool_configure (pool, caps, 1, 0));
  gst_object_unref (pool);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_caps_beyond_the_limit_are_refused_by_name)
{
  gstrange::RangeInfo parsed;
  GstCaps *caps =
      gstrange::make_range_caps (gstrange::make_info (ring_rig (64, 2048, 2048), 30, 1));
  fail_unless_contains (gstrange::parse_caps (caps, parsed).message (), "134217728");
  gst_caps_unref (caps);
  caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (2), 30, 1));
  gst_caps_set_simple (
      caps, "width", G_TYPE_INT, G_MAXINT, "height", G_TYPE_INT, G_MAXINT, nullptr);
  fail_unless_contains (gstrange::parse_caps (caps, parsed).message (), "134217728");
  gst_caps_unref (caps);
}
GST_END_TEST;

/* An allocator that never has memory. */
struct NoMemory {
  GstAllocator parent;
};
struct NoMemoryClass {
  GstAllocatorClass parent;
};
G_DEFINE_TYPE (NoMemory, no_memory, GST_TYPE_ALLOCATOR)
static void
no_memory_init (NoMemory *)
{
}
static void
no_memory_class_init (NoMemoryClass *klass)
{
  GST_ALLOCATOR_CLASS (klass)->alloc = [] (GstAllocator *, gsize, GstAllocationParams *) {
    return static_cast<GstMemory *> (nullptr);
  };
}

GST_START_TEST (test_lack_of_memory_is_one_error_and_no_abort)
{
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (17), 30, 1));
  auto allocator = static_cast<GstAllocator *> (g_object_new (no_memory_get_type (), nullptr));
  gst_object_ref_sink (allocator);
  GstBufferPool *pool = gst_range_buffer_pool_new ();
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, 0, 0, 0);
  gst_buffer_pool_config_set_allocator (config, allocator, nullptr);
  fail_unless (gst_buffer_pool_set_config (pool, config));
  fail_unless (gst_buffer_pool_set_active (pool, TRUE));
  GstElement *element = gst_element_factory_make ("identity", nullptr);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (element, bus);
  GstBuffer *buffer = nullptr;
  fail_unless_equals_int (gstrange::acquire (element, pool, &buffer), GST_FLOW_ERROR);
  GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
  GError *error = nullptr;
  gst_message_parse_error (message, &error, nullptr);
  fail_unless (g_error_matches (error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT));
  fail_if (gst_bus_have_pending (bus));
  g_error_free (error);
  gst_message_unref (message);
  gst_element_set_bus (element, nullptr);
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_buffer_pool_set_active (pool, FALSE);
  gst_object_unref (pool);
  gst_object_unref (allocator);
  gst_caps_unref (caps);
}
GST_END_TEST;

/* Another would be found here, or by plugins, than by this program. */
GST_START_TEST (test_process_has_one_pool_of_threads)
{
  Dl_info found{};
  ck_assert_int_ne (dladdr (reinterpret_cast<void *> (&rangecast_run_workers), &found), 0);
  fail_unless (found.dli_sname != nullptr);
  ck_assert_ptr_eq (dlsym (RTLD_DEFAULT, found.dli_sname), found.dli_saddr);
  ck_assert_ptr_eq (found.dli_saddr, reinterpret_cast<void *> (&rangecast_run_workers));
}
GST_END_TEST;

static Suite *
gstrange_suite ()
{
  Suite *suite = suite_create ("gstrange");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_caps_carry_the_rig_and_come_back_equal);
  tcase_add_test (tc, test_bad_caps_are_refused_by_field);
  tcase_add_test (tc, test_application_reads_camera_from_caps);
  tcase_add_test (tc, test_caps_of_cameras_give_the_same_cameras);
  tcase_add_test (tc, test_cameras_out_of_range_are_an_error);
  tcase_add_test (tc, test_append_shares_memory_and_shifts_offsets);
  tcase_add_test (tc, test_append_refuses_the_same_view_twice);
  tcase_add_test (tc, test_merged_memory_keeps_the_views_where_they_are);
  tcase_add_test (tc, test_metas_that_point_outside_are_refused);
  tcase_add_test (tc, test_copies_of_whole_buffers_keep_views_and_regions_lose_them);
  tcase_add_test (tc, test_crop_moves_the_planes_without_touching_pixels);
  tcase_add_test (tc, test_pool_recycles_buffers_with_any_roi);
  tcase_add_test (tc, test_pool_recycles_buffers_of_up_to_64_views_with_other_rois);
  tcase_add_test (tc, test_views_of_64_buffers_are_where_they_were_after_append);
  tcase_add_test (tc, test_a_pool_gets_memories_back_that_went_into_another_buffer);
  tcase_add_test (tc, test_view_larger_than_the_caps_is_refused);
  tcase_add_test (tc, test_frame_set_beyond_the_limit_is_refused);
  tcase_add_test (tc, test_caps_beyond_the_limit_are_refused_by_name);
  tcase_add_test (tc, test_lack_of_memory_is_one_error_and_no_abort);
  tcase_add_test (tc, test_process_has_one_pool_of_threads);
  return suite;
}

GST_CHECK_MAIN (gstrange);
