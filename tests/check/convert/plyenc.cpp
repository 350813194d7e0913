/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

#include <algorithm>
#include <cstring>
#include <glib/gstdio.h>
#include <random>
#include <string>
#include <string_view>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

struct Ply {
  std::size_t points = 0;
  std::vector<float> xyz, normals;
  std::vector<guint8> rgb, view_id;
};

static Ply
parse_ply (GstBuffer *buffer, bool with_view_id, bool with_normals = false)
{
  GstMapInfo map;
  fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
  const std::string_view text (reinterpret_cast<const char *> (map.data), map.size);
  const auto end = text.find ("end_header\n");
  ck_assert_uint_ne (end, text.npos);
  fail_unless (text.starts_with ("ply\nformat binary_little_endian 1.0\n"));
  const auto element = text.find ("element vertex ");
  Ply ply;
  ply.points = std::strtoul (text.data () + element + 15, nullptr, 10);
  const guint8 *at = map.data + end + 11;
  const std::size_t stride = (with_normals ? 27 : 15) + (with_view_id ? 1 : 0);
  const std::size_t colour = with_normals ? 24 : 12;
  fail_unless_equals_int (map.size - (end + 11), ply.points * stride);
  for (std::size_t i = 0; i < ply.points; i++, at += stride) {
    float xyz[3];
    std::memcpy (xyz, at, sizeof xyz);
    ply.xyz.insert (ply.xyz.end (), xyz, xyz + 3);
    if (with_normals) {
      std::memcpy (xyz, at + 12, sizeof xyz);
      ply.normals.insert (ply.normals.end (), xyz, xyz + 3);
    }
    ply.rgb.insert (ply.rgb.end (), at + colour, at + colour + 3);
    if (with_view_id)
      ply.view_id.push_back (at[colour + 3]);
  }
  gst_buffer_unmap (buffer, &map);
  return ply;
}

static GstHarness *
ply_harness (const Rig &rig)
{
  GstHarness *h = gst_harness_new ("plyenc");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

GST_START_TEST (test_point_is_where_the_camera_saw_it)
{
  const Rig rig = ring_rig (2);
  GstBuffer *input = make_frame_set (rig, 7);
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READWRITE);
    for (const auto &view : frame.views ())
      for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++)
          view.depth.at (x, y) = 0;
    frame.views ()[1].depth.at (319, 239) = 8000;
  }
  GstHarness *h = ply_harness (rig);
  g_object_set (h->element, "view-id", TRUE, nullptr);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  const Ply ply = parse_ply (output, true);
  fail_unless_equals_int (ply.points, 1);
  /* View 1 stands behind (-z) and looks along +z; its x axis is the world's -x. */
  fail_unless_cmp (std::abs (ply.xyz[0] - -159.5 / 320 * 0.8), <, 1e-6);
  fail_unless_cmp (std::abs (ply.xyz[1] - -119.5 / 320 * 0.8), <, 1e-6);
  fail_unless_cmp (std::abs (ply.xyz[2] - 0.0), <, 1e-6);
  fail_unless_equals_int (ply.view_id[0], 1);
  fail_unless_equals_int (ply.rgb[0], 319 % 256);
  fail_unless_equals_int (ply.rgb[1], 239);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 7);
  fail_unless_equals_int (gst_buffer_n_range_metas (output), 0);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_only_valid_pixels_of_the_roi_are_points)
{
  const Rig rig = ring_rig (3);
  GstBuffer *input = make_frame_set (rig, 0, {100, 50, 37, 41});
  std::size_t valid = 0;
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READ);
    for (const auto &view : frame.views ())
      for (int y = 0; y < 41; y++)
        for (int x = 0; x < 37; x++)
          valid += view.depth.at (x, y) != 0;
  }
  GstHarness *h = ply_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  ck_assert_uint_gt (valid, 1000);
  fail_unless_equals_int (parse_ply (output, false).points, valid);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_empty_frame_set_is_a_file_without_points)
{
  const Rig rig = ring_rig (1);
  GstBuffer *input = gst_range_buffer_new (1, 8, 8);
  gst_range_buffer_add_view (input, 0, 0, 0, 0, 0, 0);
  GstHarness *h = ply_harness (rig);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  fail_unless_equals_int (parse_ply (output, false).points, 0);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Of a frame set of one view in which these pixels of the first two rows are valid. */
static std::string
glb_of (const std::vector<int> &columns)
{
  const Rig rig = ring_rig (1);
  GstBuffer *input = make_frame_set (rig);
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READWRITE);
    const auto &depth = frame.views ()[0].depth;
    for (int y = 0; y < 240; y++)
      std::fill_n (depth.row (y), 320, 0);
    for (const int x : columns)
      depth.at (x, 0) = depth.at (x, 1) = 8000;
  }
  GstHarness *h = gst_harness_new ("plyenc");
  gst_harness_set_sink_caps_str (h, "model/gltf-binary");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  std::string file (gst_buffer_get_size (output), 0);
  gst_buffer_extract (output, 0, file.data (), file.size ());
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return file;
}

GST_START_TEST (test_gltf_is_a_mesh_a_cloud_or_an_empty_scene)
{
  const struct {
    std::vector<int> columns;
    const char *has;
    std::size_t binary; /* bytes of the vertices and indices */
  } cases[] = {{{}, "\"scenes\":[{}]", 0}, {{3, 9}, "\"mode\":0}", 4 * 20},
      {{3, 4, 9}, "\"mode\":4,\"indices\":2", 6 * 20 + 2 * 3 * 4}};
  for (const auto &[columns, has, binary] : cases) {
    const std::string file = glb_of (columns);
    guint32 head[5];
    std::memcpy (head, file.data (), sizeof head);
    fail_unless (file.starts_with ("glTF"));
    fail_unless_equals_int (head[2], file.size ());
    fail_unless_equals_int (head[3] % 4, 0);
    fail_unless_equals_int (file.size (), 20 + head[3] + (binary ? 8 + binary : 0));
    fail_unless_contains (file.substr (20, head[3]), has);
    if (binary == 0)
      continue;
    /* The first vertex: where the camera saw it, in linear light. */
    float xyz[3];
    guint16 rgba[4];
    std::memcpy (xyz, file.data () + 28 + head[3], sizeof xyz);
    std::memcpy (rgba, file.data () + 40 + head[3], sizeof rgba);
    fail_unless_cmp (std::abs (xyz[0] - (3 - 159.5) / 320 * 0.8), <, 1e-6);
    fail_unless_equals_int (rgba[0], 60); /* level 3: 3 / 255 / 12.92 */
    fail_unless_equals_int (rgba[3], 65535);
  }
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  GstHarness *h = ply_harness (ring_rig (1));
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  fail_unless_equals_int (gst_harness_push (h, make_frame_set (ring_rig (2))), GST_FLOW_ERROR);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "no view 1");
  fail_if (gst_bus_have_pending (bus) && gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) != nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_works_again_after_null)
{
  GstElement *pipeline = gst_parse_launch ("appsrc name=a ! plyenc ! fakesink", nullptr);
  for (int i = 0; i < 2; i++) {
    ck_assert_int_ne (
        gst_element_set_state (pipeline, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    fail_unless_equals_int (
        gst_element_set_state (pipeline, GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_second_cloud_for_one_file_is_one_error)
{
  gchar *folder = g_dir_make_tmp ("rangecast-clouds-XXXXXX", nullptr);
  gchar *file = g_build_filename (folder, "two.ply", nullptr);
  gchar *launch = g_strdup_printf ("avatartestsrc num-buffers=2 ! video/x-range,width=32,height=24 "
                                   "! plyenc ! filesink location=%s",
      file);
  GstElement *pipeline = gst_parse_launch (launch, nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 30 * GST_SECOND, GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_EOS));
  fail_unless_equals_int (GST_MESSAGE_TYPE (message), GST_MESSAGE_ERROR);
  GError *error = nullptr;
  gst_message_parse_error (message, &error, nullptr);
  fail_unless_contains (error->message, "multifilesink");
  g_error_free (error);
  GstObject *encoder = GST_MESSAGE_SRC (message);
  while (GstMessage *more = gst_bus_timed_pop_filtered (bus, GST_SECOND / 4, GST_MESSAGE_ERROR)) {
    ck_assert_ptr_ne (GST_MESSAGE_SRC (more), encoder);
    gst_message_unref (more);
  }
  gst_message_unref (message);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  g_remove (file);
  g_rmdir (folder);
  g_free (launch);
  g_free (file);
  g_free (folder);
}
GST_END_TEST;

/* A flush starts the file again. */
GST_START_TEST (test_cloud_after_a_seek_goes_into_the_file)
{
  gchar *folder = g_dir_make_tmp ("rangecast-clouds-XXXXXX", nullptr);
  gchar *file = g_build_filename (folder, "one.ply", nullptr);
  gchar *recording = g_build_filename (folder, "two-seconds.rcnc", nullptr);
  gchar *launch = g_strdup_printf (
      "avatartestsrc num-buffers=20 ! video/x-range,width=32,height=24,framerate=10/1 "
      "! neighbourcodeenc temporal=false ! filesink location=%s",
      recording);
  GstElement *pipeline = gst_parse_launch (launch, nullptr);
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
  g_free (launch);
  launch = g_strdup_printf ("filesrc location=%s ! neighbourcodeparse ! neighbourcodedec "
                            "! plyenc ! filesink location=%s",
      recording, file);
  pipeline = gst_parse_launch (launch, nullptr);
  gst_element_set_state (pipeline, GST_STATE_PAUSED);
  ck_assert_int_eq (gst_element_get_state (pipeline, nullptr, nullptr, 60 * GST_SECOND),
      GST_STATE_CHANGE_SUCCESS);
  fail_unless (gst_element_seek (pipeline, 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
      GST_SEEK_TYPE_SET, GST_SECOND, GST_SEEK_TYPE_SET, GST_SECOND + GST_SECOND / 20));
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
  gchar *bytes = nullptr;
  fail_unless (g_file_get_contents (file, &bytes, nullptr, nullptr));
  fail_unless (g_str_has_prefix (bytes, "ply\n"));
  g_free (bytes);
  g_remove (file);
  g_remove (recording);
  g_rmdir (folder);
  g_free (launch);
  g_free (file);
  g_free (recording);
  g_free (folder);
}
GST_END_TEST;

GST_START_TEST (test_several_clouds_go_into_numbered_files)
{
  gchar *folder = g_dir_make_tmp ("rangecast-clouds-XXXXXX", nullptr);
  gchar *launch = g_strdup_printf ("avatartestsrc num-buffers=3 ! video/x-range,width=32,height=24 "
                                   "! plyenc ! multifilesink location=%s/%%d.ply",
      folder);
  GstElement *pipeline = gst_parse_launch (launch, nullptr);
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
  for (int i = 0; i < 3; i++) {
    gchar *file = g_strdup_printf ("%s/%d.ply", folder, i);
    fail_unless (g_file_test (file, G_FILE_TEST_IS_REGULAR), "%s", file);
    g_remove (file);
    g_free (file);
  }
  g_rmdir (folder);
  g_free (launch);
  g_free (folder);
}
GST_END_TEST;

/* ---- normals ---- */

/* A frame set of one view, its depths in units of 0.1 mm from column and row. */
template <typename DepthAt>
static GstBuffer *
make_depths (const Rig &rig, DepthAt depth_at)
{
  GstBuffer *buffer = make_frame_set (rig);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const auto &image : frame.views ())
    for (int y = 0; y < image.depth.height; y++)
      for (int x = 0; x < image.depth.width; x++)
        image.depth.at (x, y) = static_cast<std::uint16_t> (depth_at (x, y));
  return buffer;
}

static Ply
normals_of (const Rig &rig, GstBuffer *input)
{
  GstHarness *h = ply_harness (rig);
  g_object_set (h->element, "normals", TRUE, nullptr);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  const Ply ply = parse_ply (output, false, true);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return ply;
}

/* The cosine between a point's normal and a direction of length 1. */
static double
along (const Ply &ply, std::size_t i, Vec3 direction)
{
  return dot ({ply.normals[3 * i], ply.normals[3 * i + 1], ply.normals[3 * i + 2]}, direction);
}

/* View 1 of three, so that the world is not the camera's frame; the plane is seen at 60 degrees. */
GST_START_TEST (test_normals_of_a_slanted_plane_are_the_planes)
{
  Rig rig = ring_rig (3);
  rig.views = {rig.views[1]};
  const View &view = rig.views[0];
  const Vec3 normal = {std::sin (M_PI / 3) * 0.6, std::sin (M_PI / 3) * 0.8, -0.5};
  GstBuffer *input = make_depths (rig, [&] (int x, int y) {
    const double z = 0.5 * 0.8 / -dot (normal, view.intrinsics.unproject (x, y, 1));
    return z > 0.3 && z < 2 ? std::round (z / view.depth_unit_m) : 0;
  });
  const Ply ply = normals_of (rig, input);
  ck_assert_uint_gt (ply.points, 30000);
  const Vec3 in_world = view.world_from_view.rotation * normal;
  double worst = 1;
  for (std::size_t i = 0; i < ply.points; i++)
    worst = std::min (worst, along (ply, i, in_world));
  fail_unless (worst > 0.999, "%f", worst);
}
GST_END_TEST;

GST_START_TEST (test_normals_do_not_mix_two_surfaces)
{
  const Rig rig = ring_rig (1);
  const Ply ply = normals_of (
      rig, make_depths (rig, [] (int x, int y) { return (x / 20 + y / 20) % 2 ? 6000 : 8000; }));
  fail_unless_equals_int (ply.points, 320 * 240);
  double worst = 1;
  for (std::size_t i = 0; i < ply.points; i++)
    worst = std::min (worst, along (ply, i, {0, 0, 1}));
  fail_unless (worst > 0.99999, "%f", worst);
}
GST_END_TEST;

GST_START_TEST (test_normal_of_a_lone_point_or_line_is_towards_the_camera)
{
  const Rig rig = ring_rig (1);
  const Ply ply = normals_of (rig, make_depths (rig, [] (int x, int y) {
    return (x == 10 && y == 20) || (y == 100 && x >= 50 && x < 60) ? 8000 : 0;
  }));
  fail_unless_equals_int (ply.points, 11);
  for (std::size_t i = 0; i < ply.points; i++) {
    const Vec3 to_camera =
        Vec3{0, 0, 0.8} - Vec3{ply.xyz[3 * i], ply.xyz[3 * i + 1], ply.xyz[3 * i + 2]};
    fail_unless_cmp (along (ply, i, 1 / norm (to_camera) * to_camera), >, 0.99999);
  }
}
GST_END_TEST;

GST_START_TEST (test_normals_of_noise_have_length_1_and_face_the_camera)
{
  const Rig rig = ring_rig (1);
  std::mt19937 random (1);
  for (const int limit : {65535, 3}) {
    const Ply ply =
        normals_of (rig, make_depths (rig, [&] (int, int) { return random () % (limit + 1); }));
    ck_assert_uint_gt (ply.points, 50000);
    double length_error = 0, backwards = 0;
    bool has_nan = false;
    for (std::size_t i = 0; i < ply.points; i++) {
      const Vec3 n = {ply.normals[3 * i], ply.normals[3 * i + 1], ply.normals[3 * i + 2]};
      const Vec3 point = {ply.xyz[3 * i], ply.xyz[3 * i + 1], ply.xyz[3 * i + 2]};
      has_nan |= std::isnan (norm (n));
      length_error = std::max (length_error, std::abs (norm (n) - 1));
      backwards = std::min (backwards, dot (n, Vec3{0, 0, 0.8} - point));
    }
    fail_if (has_nan);
    fail_unless (length_error < 1e-5, "%g", length_error);
    fail_unless (backwards > -1e-6, "%g", backwards);
  }
}
GST_END_TEST;

/* The file of an image cut to a ROI, all of which is invalid but 5 x 5 pixels round (110, 60). */
static Ply
cut_to (const Rig &rig, const Roi &roi)
{
  GstBuffer *input = make_depths (rig, [] (int x, int y) {
    return std::abs (x - 110) <= 2 && std::abs (y - 60) <= 2 ? 7000 + 10 * x + 3 * y : 0;
  });
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READWRITE);
    frame.crop (0, roi);
  }
  GstHarness *h = ply_harness (rig);
  g_object_set (h->element, "normals", TRUE, nullptr);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  Ply ply = parse_ply (output, false, true);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return ply;
}

GST_START_TEST (test_points_and_normals_of_a_cut_roi_are_those_of_the_whole_image)
{
  Rig rig = ring_rig (3);
  rig.views = {rig.views[1]};
  const Ply whole = cut_to (rig, {0, 0, 320, 240});
  fail_unless_equals_int (whole.points, 25);
  for (const Roi &roi : {Roi{100, 50, 37, 41}, Roi{108, 58, 5, 5}, Roi{3, 57, 300, 9}}) {
    const Ply part = cut_to (rig, roi);
    fail_unless_cmp (part.xyz, ==, whole.xyz);
    fail_unless_cmp (part.normals, ==, whole.normals);
    fail_unless_cmp (part.rgb, ==, whole.rgb);
  }
}
GST_END_TEST;

static Suite *
plyenc_suite ()
{
  Suite *suite = suite_create ("plyenc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_point_is_where_the_camera_saw_it);
  tcase_add_test (tc, test_only_valid_pixels_of_the_roi_are_points);
  tcase_add_test (tc, test_empty_frame_set_is_a_file_without_points);
  tcase_add_test (tc, test_gltf_is_a_mesh_a_cloud_or_an_empty_scene);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_works_again_after_null);
  tcase_add_test (tc, test_second_cloud_for_one_file_is_one_error);
  tcase_add_test (tc, test_cloud_after_a_seek_goes_into_the_file);
  tcase_add_test (tc, test_several_clouds_go_into_numbered_files);
  tcase_add_test (tc, test_normals_of_a_slanted_plane_are_the_planes);
  tcase_add_test (tc, test_normals_do_not_mix_two_surfaces);
  tcase_add_test (tc, test_normal_of_a_lone_point_or_line_is_towards_the_camera);
  tcase_add_test (tc, test_normals_of_noise_have_length_1_and_face_the_camera);
  tcase_add_test (tc, test_points_and_normals_of_a_cut_roi_are_those_of_the_whole_image);
  return suite;
}

GST_CHECK_MAIN (plyenc);
