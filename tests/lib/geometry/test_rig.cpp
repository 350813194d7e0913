/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <rangecast/rigfile/rig_file.hpp>

using namespace rangecast;
using rangecast::testing::ring_rig;

namespace {

Rig
stereo_rig ()
{
  Rig rig = ring_rig (3);
  View &view = rig.views[1];
  view.name = "left of the door";
  view.distortion = {0.1, -0.2, 0.001, 0.002, 0.05};
  PartnerCamera right;
  right.intrinsics = {321, 322, 158, 121};
  right.distortion = std::vector<double> (14, 0.01);
  right.partner_from_left.translation = {-0.1, 0, 0};
  view.right = right;
  right.partner_from_left.translation = {0, 0.1, 0};
  view.third = right;
  return rig;
}

void
expect_equal (const Rig &a, const Rig &b)
{
  ASSERT_EQ (a.views.size (), b.views.size ());
  for (std::size_t i = 0; i < a.views.size (); i++) {
    const View &x = a.views[i], &y = b.views[i];
    EXPECT_EQ (x.id, y.id);
    EXPECT_EQ (x.name, y.name);
    EXPECT_EQ (x.width, y.width);
    EXPECT_EQ (x.distortion, y.distortion);
    EXPECT_EQ (x.near_m, y.near_m);
    EXPECT_EQ (x.depth_unit_m, y.depth_unit_m);
    EXPECT_EQ (x.intrinsics.fx, y.intrinsics.fx);
    for (int k = 0; k < 9; k++)
      EXPECT_EQ (x.world_from_view.rotation[k], y.world_from_view.rotation[k]);
    ASSERT_EQ (x.right.has_value (), y.right.has_value ());
    ASSERT_EQ (x.third.has_value (), y.third.has_value ());
    if (x.right) {
      EXPECT_EQ (x.right->distortion, y.right->distortion);
    }
    if (x.third) {
      EXPECT_EQ (
          x.third->partner_from_left.translation.y, y.third->partner_from_left.translation.y);
    }
  }
}

std::string
temporary (const std::string &name)
{
  return ::testing::TempDir () + "rangecast-" + std::to_string (getpid ()) + "-" + name;
}

std::string
message_of_file (const std::string &text)
{
  const std::string path = temporary ("bad.yaml");
  std::ofstream (path) << text;
  Rig rig;
  const Status status = load_rig (path, rig);
  std::filesystem::remove (path);
  EXPECT_FALSE (status.ok ());
  EXPECT_TRUE (status.message ().starts_with (path)) << status.message ();
  return status.message ();
}

} // namespace

TEST (Rig, yaml_and_json_files_round_trip)
{
  for (const char *name : {"rig.yaml", "rig.json", "rig.yml"}) {
    const std::string path = temporary (name);
    const Rig rig = stereo_rig ();
    ASSERT_TRUE (save_rig (path, rig).ok ());
    Rig loaded;
    const Status status = load_rig (path, loaded);
    EXPECT_TRUE (status.ok ()) << status.message ();
    expect_equal (rig, loaded);
    std::filesystem::remove (path);
  }
}

TEST (Rig, what_cannot_be_written_is_named)
{
  EXPECT_NE (save_rig ("/nowhere/rig.yaml", stereo_rig ()).message ().find ("/nowhere/rig.yaml"),
      std::string::npos);
  const std::string path = temporary ("rig.txt");
  EXPECT_EQ (save_rig (path, stereo_rig ()).code (), StatusCode::kBadValue);
  EXPECT_FALSE (std::filesystem::exists (path));
  if (std::filesystem::exists ("/dev/full")) { // every write to it fails
    const std::string full = temporary ("full.yaml");
    std::filesystem::create_symlink ("/dev/full", full);
    EXPECT_EQ (save_rig (full, stereo_rig ()).code (), StatusCode::kNoSpace);
    std::filesystem::remove (full);
  }
}

TEST (Rig, place_to_write_to_is_tried_and_left_as_it_was)
{
  const std::string path = temporary ("place.yaml"), link = temporary ("link.yaml");
  EXPECT_TRUE (check_output_path (path, kRigExtensions).ok ());
  EXPECT_FALSE (std::filesystem::exists (path));
  std::filesystem::create_symlink (path, link);
  EXPECT_TRUE (check_output_path (link, kRigExtensions).ok ());
  EXPECT_FALSE (std::filesystem::exists (path));
  EXPECT_TRUE (std::filesystem::is_symlink (link));
  std::ofstream (path) << "text";
  EXPECT_TRUE (check_output_path (path, kRigExtensions).ok ());
  EXPECT_EQ (std::filesystem::file_size (path), 4U);
  std::filesystem::remove (link);
  std::filesystem::remove (path);
  std::filesystem::create_directory (path);
  EXPECT_NE (
      check_output_path (path, kRigExtensions).message ().find ("is a folder"), std::string::npos);
  std::filesystem::remove (path);
  EXPECT_NE (check_output_path ("/nowhere/rig.yaml", kRigExtensions)
                 .message ()
                 .find ("folder does not exist"),
      std::string::npos);
  EXPECT_EQ (
      check_output_path (temporary ("rig.txt"), kRigExtensions).code (), StatusCode::kBadValue);
  if (std::filesystem::is_directory ("/proc")) {
    EXPECT_NE (
        check_output_path ("/proc/rig.yaml", kRigExtensions).message ().find ("cannot be opened"),
        std::string::npos);
  }
}

TEST (Rig, blob_round_trips_bit_for_bit)
{
  const Rig rig = stereo_rig ();
  const auto blob = encode_rig (rig);
  Rig decoded;
  ASSERT_TRUE (decode_rig (blob, decoded).ok ());
  expect_equal (rig, decoded);
  EXPECT_EQ (blob, encode_rig (decoded));
}

TEST (Rig, every_truncated_blob_is_refused)
{
  const auto blob = encode_rig (stereo_rig ());
  for (std::size_t size = 0; size < blob.size (); size++) {
    const auto copy = std::make_unique<std::uint8_t[]> (size);
    std::memcpy (copy.get (), blob.data (), size);
    Rig rig;
    EXPECT_FALSE (decode_rig ({copy.get (), size}, rig).ok ()) << size;
    EXPECT_TRUE (rig.views.empty ());
  }
}

TEST (Rig, blob_with_trailing_bytes_bad_magic_or_future_version_is_refused)
{
  const auto good = encode_rig (stereo_rig ());
  Rig rig;
  auto bad = good;
  bad.push_back (0);
  EXPECT_EQ (decode_rig (bad, rig).code (), StatusCode::kBadData);
  bad = good;
  bad[0] = 'X';
  EXPECT_EQ (decode_rig (bad, rig).code (), StatusCode::kBadData);
  bad = good;
  bad[4] = 2;
  EXPECT_EQ (decode_rig (bad, rig).code (), StatusCode::kUnsupported);
}

TEST (Rig, no_bit_flip_in_a_blob_crashes_or_gives_an_invalid_rig)
{
  const auto good = encode_rig (stereo_rig ());
  for (std::size_t bit = 0; bit < good.size () * 8; bit++) {
    auto bad = good;
    bad[bit / 8] ^= 1 << bit % 8;
    Rig rig;
    if (decode_rig (bad, rig).ok ()) {
      EXPECT_TRUE (validate (rig).ok ());
    }
  }
}

TEST (Rig, message_of_a_bad_file_names_the_field)
{
  EXPECT_NE (message_of_file ("hello").find ("rig"), std::string::npos);
  EXPECT_NE (
      message_of_file ("%YAML:1.0\n---\nfoo: 1\n").find ("rangecast_rig"), std::string::npos);
  EXPECT_NE (message_of_file ("%YAML:1.0\n---\nrangecast_rig: 9\nviews: []\n").find ("version 9"),
      std::string::npos);
  EXPECT_NE (message_of_file ("%YAML:1.0\n---\nrangecast_rig: 1\nviews:\n  - id: 0\n"
                              "    image_size: [ 320, 240 ]\n    intrinsics: [ 1, 2 ]\n")
                 .find ("views[0].intrinsics"),
      std::string::npos);
  const std::string view = "%YAML:1.0\n---\nrangecast_rig: 1\nviews:\n  - id: ";
  EXPECT_NE (message_of_file (view + "0\n    image_size: [ 640.5, 480 ]\n")
                 .find ("views[0].image_size: must be whole numbers"),
      std::string::npos);
  EXPECT_NE (message_of_file (view + "0\n    camera: 22301001\n")
                 .find ("views[0].camera: is no text (put a serial number in quotes)"),
      std::string::npos);
  EXPECT_NE (message_of_file (view + "99999999999999999999\n")
                 .find ("views[0].id: must be an integer from 0 to 63"),
      std::string::npos);
}

TEST (Rig, missing_file_is_named)
{
  Rig rig;
  const Status status = load_rig ("/nowhere/rig.yaml", rig);
  EXPECT_EQ (status.code (), StatusCode::kNotFound);
  EXPECT_NE (status.message ().find ("/nowhere/rig.yaml"), std::string::npos);
  EXPECT_NE (
      load_rig ("/dev/null", rig).message ().find ("is a folder or a device"), std::string::npos);
}

TEST (Rig, validate_names_view_and_field)
{
  Rig rig = ring_rig (2);
  rig.views[1].near_m = -1;
  EXPECT_NE (validate (rig).message ().find ("view 1: near and far are -1 and"), std::string::npos);
  rig = ring_rig (2);
  rig.views[1].id = 0;
  EXPECT_NE (validate (rig).message ().find ("twice"), std::string::npos);
  rig = ring_rig (1);
  rig.views[0].intrinsics.fx = std::numeric_limits<double>::quiet_NaN ();
  EXPECT_NE (validate (rig).message ().find ("intrinsics"), std::string::npos);
  rig = ring_rig (1);
  rig.views[0].intrinsics.fy = 1e-38; // would put points beyond all floats
  EXPECT_NE (validate (rig).message ().find ("0.001"), std::string::npos);
  rig = ring_rig (1);
  rig.views[0].world_from_view.rotation[0] = 2;
  EXPECT_NE (validate (rig).message ().find ("rotation"), std::string::npos);
  rig = ring_rig (1);
  rig.views[0].distortion = {1, 2, 3};
  EXPECT_NE (validate (rig).message ().find ("distortion"), std::string::npos);
}

TEST (Rig, merge_unites_and_refuses_one_id_for_two_cameras)
{
  Rig all = ring_rig (4), some;
  some.views = {all.views[2]};
  ASSERT_TRUE (merge (some, all).ok ());
  EXPECT_EQ (some.views.size (), 4u);
  EXPECT_EQ (some.views[0].id, 0);
  Rig other = ring_rig (1);
  other.views[0].intrinsics.fx += 1;
  EXPECT_EQ (merge (some, other).code (), StatusCode::kBadValue);
  EXPECT_EQ (some.views.size (), 4u);
}

TEST (Rig, view_is_scaled_with_its_partners_if_the_shape_fits)
{
  View view = rangecast::testing::ring_view (3, 20, 0.8, 640, 480);
  view.right = PartnerCamera{{500, 510, 300, 200}, {-0.1, 0, 0, 0}, {kIdentity3, {-0.1, 0, 0}}};
  view.third = PartnerCamera{{400, 410, 310, 210}, {}, {kIdentity3, {0, 0.1, 0}}};
  EXPECT_EQ (scale_view (view, 640, 360).code (), StatusCode::kBadSize);
  EXPECT_EQ (scale_view (view, 0, 0).code (), StatusCode::kBadSize);
  EXPECT_EQ (view.width, 640);
  ASSERT_TRUE (scale_view (view, 1280, 960).ok ());
  EXPECT_EQ (view.height, 960);
  EXPECT_DOUBLE_EQ (view.intrinsics.fx, 1280);
  EXPECT_DOUBLE_EQ (view.intrinsics.cx, 639.5);
  EXPECT_DOUBLE_EQ (view.right->intrinsics.fy, 1020);
  EXPECT_DOUBLE_EQ (view.right->intrinsics.cx, 600.5);
  EXPECT_DOUBLE_EQ (view.third->intrinsics.cy, 420.5);
  EXPECT_EQ (view.right->distortion[0], -0.1);
  EXPECT_EQ (view.right->partner_from_left.translation.x, -0.1);
}
