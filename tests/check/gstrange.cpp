/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_caps_carry_the_rig_and_come_back_equal)
{
  const auto info = gstrange::make_info (ring_rig (4), 30, 1);
  GstCaps *caps = gstrange::make_range_caps (info);
  gstrange::RangeInfo parsed;
  fail_unless (gstrange::parse_caps (caps, parsed).ok ());
  fail_unless_equals_int (parsed.width, 320);
  fail_unless_equals_int (parsed.views (), 4);
  fail_unless_equals_uint64 (parsed.frame_duration (), GST_SECOND / 30);
  fail_unless (encode_rig (parsed.rig) == encode_rig (info.rig));
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
  fail_unless (
      gstrange::parse_caps (caps, parsed).message ().find ("views=3") != std::string::npos);
  gst_caps_set_simple (caps, "views", G_TYPE_INT, 2, "width", G_TYPE_INT, 100, nullptr);
  fail_unless (gstrange::parse_caps (caps, parsed).message ().find ("larger") != std::string::npos);
  gst_structure_remove_field (gst_caps_get_structure (caps, 0), "rig");
  fail_unless (gstrange::parse_caps (caps, parsed).message ().find ("rig") != std::string::npos);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_application_reads_camera_from_caps)
{
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (ring_rig (4), 30, 1));
  GstRangeCamera camera;
  fail_unless (gst_range_caps_get_camera (caps, 1, &camera));
  fail_unless_equals_float (camera.fx, 320);
  fail_unless (std::abs (camera.world_from_view[3] - 0.8) < 1e-9);
  fail_if (gst_range_caps_get_camera (caps, 4, &camera));
  fail_if (gst_range_caps_get_camera (caps, 4000000000u, &camera));
  gst_caps_unref (caps);
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
  fail_unless (gst_buffer_peek_memory (a, 1) == gst_buffer_peek_memory (b, 0));
  {
    gstrange::RangeFrameMap frame (a, GST_MAP_READ), part (b, GST_MAP_READ);
    fail_unless (frame.views ()[1].depth.data == part.views ()[0].depth.data);
    fail_unless (frame.views ()[1].colour.data == part.views ()[0].colour.data);
    fail_unless (frame.views ()[1].roi == (Roi{10, 20, 33, 17}));
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
    fail_unless (frame.views ()[0].roi == (Roi{140, 100, 50, 40}));
    fail_unless_equals_int (frame.views ()[0].depth.at (10, 10), expected);
    fail_unless_equals_int (frame.views ()[0].colour.at (10, 10).r, 150);
    frame.crop (0, {});
  }
  {
    gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
    fail_unless (frame.status ().ok ());
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

static Suite *
gstrange_suite ()
{
  Suite *suite = suite_create ("gstrange");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_caps_carry_the_rig_and_come_back_equal);
  tcase_add_test (tc, test_bad_caps_are_refused_by_field);
  tcase_add_test (tc, test_application_reads_camera_from_caps);
  tcase_add_test (tc, test_append_shares_memory_and_shifts_offsets);
  tcase_add_test (tc, test_append_refuses_the_same_view_twice);
  tcase_add_test (tc, test_merged_memory_keeps_the_views_where_they_are);
  tcase_add_test (tc, test_metas_that_point_outside_are_refused);
  tcase_add_test (tc, test_copies_of_whole_buffers_keep_views_and_regions_lose_them);
  tcase_add_test (tc, test_crop_moves_the_planes_without_touching_pixels);
  tcase_add_test (tc, test_pool_recycles_buffers_with_any_roi);
  return suite;
}

GST_CHECK_MAIN (gstrange);
