/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The text of rig files against cv::FileStorage, which must be able to read and write the same. */
#include "test-support.hpp"

#include <cctype>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/core/persistence.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/rigfile/rig_text.hpp>
#include <regex>
#include <span>

using namespace rangecast;
using rangecast::testing::ring_rig;

namespace {

void
write_numbers (cv::FileStorage &file, const char *name, std::span<const double> values)
{
  file.startWriteStruct (name, cv::FileNode::SEQ | cv::FileNode::FLOW);
  for (double v : values)
    file << v;
  file.endWriteStruct ();
}

void
write_pose (cv::FileStorage &file, const char *name, const Pose &pose)
{
  const double t[] = {pose.translation.x, pose.translation.y, pose.translation.z};
  file.startWriteStruct (name, cv::FileNode::MAP);
  write_numbers (file, "rotation", pose.rotation);
  write_numbers (file, "translation", t);
  file.endWriteStruct ();
}

void
write_lens (cv::FileStorage &file, const Intrinsics &k, const Distortion &distortion)
{
  const double values[] = {k.fx, k.fy, k.cx, k.cy};
  write_numbers (file, "intrinsics", values);
  if (!distortion.empty ())
    write_numbers (file, "distortion", distortion);
}

void
write_camera (cv::FileStorage &file, const std::string &camera)
{
  if (!camera.empty ())
    file.write ("camera", camera);
}

void
write_partner (cv::FileStorage &file, const char *name, const std::optional<PartnerCamera> &partner)
{
  if (!partner)
    return;
  file.startWriteStruct (name, cv::FileNode::MAP);
  write_camera (file, partner->camera);
  write_lens (file, partner->intrinsics, partner->distortion);
  write_pose (file, "partner_from_left", partner->partner_from_left);
  file.endWriteStruct ();
}

void
write_view (cv::FileStorage &file, const View &view)
{
  const double size[] = {double (view.width), double (view.height)};
  file.startWriteStruct ("", cv::FileNode::MAP);
  file << "id" << view.id;
  if (!view.name.empty ())
    file.write ("name", view.name);
  write_camera (file, view.camera);
  write_numbers (file, "image_size", size);
  write_lens (file, view.intrinsics, view.distortion);
  write_pose (file, "world_from_view", view.world_from_view);
  file << "depth_unit" << view.depth_unit_m << "near" << view.near_m << "far" << view.far_m;
  write_partner (file, "right", view.right);
  write_partner (file, "third", view.third);
  file.endWriteStruct ();
}

std::string
text_of_opencv (const Rig &rig, bool json)
{
  cv::FileStorage file (
      json ? "a.json" : "a.yml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  file << "rangecast_rig" << kRigFileVersion;
  file.startWriteStruct ("views", cv::FileNode::SEQ);
  for (const View &view : rig.views)
    write_view (file, view);
  file.endWriteStruct ();
  return file.releaseAndGetString ();
}

/* Later versions of OpenCV write the same numbers with fewer digits, and break lines elsewhere. */
std::string
with_plain_numbers (const std::string &text)
{
  static const std::regex piece (R"(\s+|-?\d+(\.\d*)?(e[-+]\d+)?)");
  std::string plain;
  auto end = text.cbegin ();
  for (auto i = std::sregex_iterator (text.begin (), text.end (), piece);
       i != std::sregex_iterator (); ++i) {
    char number[32] = " ";
    if (!std::isspace (static_cast<unsigned char> (*(*i)[0].first)))
      std::snprintf (number, sizeof number, "%.17g", std::strtod (i->str ().c_str (), nullptr));
    plain.append (end, (*i)[0].first).append (number);
    end = (*i)[0].second;
  }
  return plain.append (end, text.cend ());
}

void
expect_same_text (const Rig &rig)
{
  for (bool json : {false, true})
    EXPECT_EQ (
        with_plain_numbers (rig_text (rig, json)), with_plain_numbers (text_of_opencv (rig, json)));
}

std::string
temporary (const std::string &name)
{
  return ::testing::TempDir () + "rangecast-" + std::to_string (getpid ()) + "-" + name;
}

} // namespace

TEST (RigText, is_what_opencv_writes)
{
  expect_same_text ({});
  expect_same_text (ring_rig (1));
  expect_same_text (ring_rig (kMaxViews));
  Rig rig = ring_rig (2);
  rig.views[0].name = "Tom's \"left\" \\ #1: [x] \u00e9\n";
  rig.views[0].camera = "0022301001";
  rig.views[0].intrinsics = {1.0 / 3, -1e-300, 1e300, INT_MIN - 1.0};
  rig.views[0].distortion = {0.125, -3, 1e6, 0, 5e-324};
  rig.views[1].right = PartnerCamera{rig.views[0].intrinsics, {}, {}, "\t{a, b}"};
  expect_same_text (rig);
}

TEST (RigText, what_opencv_writes_is_read_back_exactly)
{
  Rig rig = ring_rig (3);
  for (View &view : rig.views) /* -0 is written as 0 */
    for (double &value : view.world_from_view.rotation)
      value += 0.0;
  rig.views[0].name = "Tom's \"left\" \\ #1: [x] \u00e9\n";
  rig.views[0].camera = "0022301001";
  rig.views[1].name = "'quoted' and not";
  rig.views[1].distortion = {1.0 / 3, -1e-300, 0, 2};
  rig.views[2].right =
      PartnerCamera{rig.views[0].intrinsics, {}, {kIdentity3, {-0.1, 0, 0}}, "\\'\\"};
  for (const char *name : {"opencv.yaml", "opencv.json"}) {
    const std::string path = temporary (name), again = temporary (std::string ("again-") + name);
    std::ofstream (path) << text_of_opencv (rig, path.ends_with ("json"));
    Rig read;
    const Status status = load_rig (path, read);
    ASSERT_TRUE (status.ok ()) << status.message ();
    EXPECT_EQ (read.views[0].name, rig.views[0].name);
    EXPECT_EQ (read.views[0].camera, rig.views[0].camera);
    EXPECT_EQ (read.views[1].name, rig.views[1].name);
    EXPECT_EQ (read.views[2].right->camera, rig.views[2].right->camera);
    EXPECT_EQ (encode_rig (read), encode_rig (rig));
    ASSERT_TRUE (save_rig (again, read).ok ());
    const auto text = [] (const std::string &name) {
      std::ifstream file (name);
      return with_plain_numbers ({std::istreambuf_iterator<char> (file), {}});
    };
    EXPECT_EQ (text (path), text (again));
    std::filesystem::remove (path);
    std::filesystem::remove (again);
  }
}

TEST (RigText, compressed_files_are_refused)
{
  const std::string path = temporary ("packed.yml.gz");
  {
    cv::FileStorage file (path, cv::FileStorage::WRITE);
    file << "rangecast_rig" << kRigFileVersion;
  }
  Rig read;
  EXPECT_NE (load_rig (path, read).message ().find ("compressed"), std::string::npos);
  std::filesystem::remove (path);
}
