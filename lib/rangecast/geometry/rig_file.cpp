/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The file form of a rig; the layout is described in docs/formats/rig.md. */
#include "rig_file.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/core/persistence.hpp>

#include "../base/storage_check.hpp"

namespace rangecast {
namespace {

constexpr int kVersion = 1;

/** Thrown and caught in this file only: what is wrong with the file's contents. */
struct BadFile {
  std::string what;
};

std::vector<double>
numbers (const cv::FileNode &node, const std::string &name, std::size_t count)
{
  std::vector<double> values;
  if (!node.isSeq ())
    throw BadFile{name + ": expected a list of numbers"};
  for (const cv::FileNode &item : node) {
    if (!item.isReal () && !item.isInt ())
      throw BadFile{name + ": expected only numbers"};
    values.push_back (item.real ());
  }
  if (count && values.size () != count)
    throw BadFile{name + ": expected " + std::to_string (count) + " numbers, got " +
                  std::to_string (values.size ())};
  return values;
}

double
number (const cv::FileNode &parent, const std::string &name, double fallback)
{
  const cv::FileNode node = parent[name];
  if (node.empty ())
    return fallback;
  if (!node.isReal () && !node.isInt ())
    throw BadFile{name + ": expected a number"};
  return node.real ();
}

Pose
read_pose (const cv::FileNode &parent, const std::string &name)
{
  const cv::FileNode node = parent[name];
  if (!node.isMap ())
    throw BadFile{name + ": expected a map with rotation and translation"};
  Pose pose;
  const auto r = numbers (node["rotation"], name + ".rotation", 9);
  std::copy (r.begin (), r.end (), pose.rotation.begin ());
  const auto t = numbers (node["translation"], name + ".translation", 3);
  pose.translation = {t[0], t[1], t[2]};
  return pose;
}

void
read_lens (const cv::FileNode &node, Intrinsics &intrinsics, Distortion &distortion)
{
  const auto k = numbers (node["intrinsics"], "intrinsics", 4);
  intrinsics = {k[0], k[1], k[2], k[3]};
  if (!node["distortion"].empty ())
    distortion = numbers (node["distortion"], "distortion", 0);
}

/** A serial number without quotes is a number to YAML, which may have lost digits of it. */
std::string
read_camera (const cv::FileNode &parent)
{
  const cv::FileNode node = parent["camera"];
  if (node.empty ())
    return {};
  if (!node.isString ())
    throw BadFile{"camera: expected a text (a serial number stands in quotes)"};
  return node.string ();
}

std::optional<PartnerCamera>
read_partner (const cv::FileNode &parent, const char *name)
{
  const cv::FileNode node = parent[name];
  if (node.empty ())
    return {};
  if (!node.isMap ())
    throw BadFile{std::string (name) + ": expected a map"};
  PartnerCamera partner;
  partner.camera = read_camera (node);
  read_lens (node, partner.intrinsics, partner.distortion);
  partner.partner_from_left = read_pose (node, "partner_from_left");
  return partner;
}

View
read_view (const cv::FileNode &node)
{
  if (!node.isMap ())
    throw BadFile{"expected a map"};
  View view;
  const cv::FileNode id = node["id"];
  /* OpenCV makes -1 of an integer that is too large, so the value is not worth printing. */
  if (!id.isInt () || static_cast<int> (id) < 0 || static_cast<int> (id) >= kMaxViews)
    throw BadFile{"id: expected an integer from 0 to " + std::to_string (kMaxViews - 1)};
  view.id = static_cast<int> (id);
  if (node["name"].isString ())
    view.name = node["name"].string ();
  view.camera = read_camera (node);
  const auto size = numbers (node["image_size"], "image_size", 2);
  for (double side : size)
    if (!(side >= 1 && side <= kMaxImageSide && side == std::floor (side)))
      throw BadFile{
          "image_size: expected whole numbers from 1 to " + std::to_string (kMaxImageSide)};
  view.width = static_cast<int> (size[0]);
  view.height = static_cast<int> (size[1]);
  read_lens (node, view.intrinsics, view.distortion);
  view.world_from_view = read_pose (node, "world_from_view");
  view.depth_unit_m = number (node, "depth_unit", view.depth_unit_m);
  view.near_m = number (node, "near", view.near_m);
  view.far_m = number (node, "far", view.far_m);
  view.right = read_partner (node, "right");
  view.third = read_partner (node, "third");
  return view;
}

Rig
read_rig (const cv::FileStorage &file)
{
  const cv::FileNode version = file["rangecast_rig"];
  if (!version.isInt ())
    throw BadFile{"no \"rangecast_rig\" version: this is not a rig file"};
  if (static_cast<int> (version) != kVersion)
    throw BadFile{"rangecast_rig version " + std::to_string (static_cast<int> (version)) +
                  ", expected " + std::to_string (kVersion)};
  const cv::FileNode views = file["views"];
  if (!views.isSeq ())
    throw BadFile{"views: expected a list"};
  Rig rig;
  for (const cv::FileNode &node : views) {
    if (rig.views.size () >= kMaxViews)
      throw BadFile{"views: at most " + std::to_string (kMaxViews)};
    try {
      rig.views.push_back (read_view (node));
    } catch (BadFile &bad) {
      throw BadFile{"views[" + std::to_string (rig.views.size ()) + "]." + bad.what};
    }
  }
  return rig;
}

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
    file << "camera" << camera;
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
    file << "name" << view.name;
  write_camera (file, view.camera);
  write_numbers (file, "image_size", size);
  write_lens (file, view.intrinsics, view.distortion);
  write_pose (file, "world_from_view", view.world_from_view);
  file << "depth_unit" << view.depth_unit_m << "near" << view.near_m << "far" << view.far_m;
  write_partner (file, "right", view.right);
  write_partner (file, "third", view.third);
  file.endWriteStruct ();
}

} // namespace

Status
load_rig (const std::string &path, Rig &rig)
{
  std::error_code error;
  const std::filesystem::file_status there = std::filesystem::status (path, error);
  if (!std::filesystem::exists (there))
    return {StatusCode::kNotFound, path + ": no such file; expected a rig file (YAML or JSON)"};
  if (!std::filesystem::is_regular_file (there))
    return {StatusCode::kNotFound,
        path + ": is a folder or a device; expected a rig file (YAML or JSON)"};
  if (std::filesystem::file_size (path, error) > kMaxRigFileSize || error)
    return {StatusCode::kBadData, path + ": expected a rig file of at most 4 MiB"};
  if (Status s = check_storage (path, {.max_bytes = kMaxRigFileSize}); !s.ok ())
    return {s.code (), s.message () + "; expected a rig file (YAML or JSON)"};
  Rig loaded;
  try {
    const cv::FileStorage file (path, cv::FileStorage::READ);
    if (!file.isOpened ())
      return {StatusCode::kBadData, path + ": cannot be read as YAML or JSON"};
    loaded = read_rig (file);
  } catch (const BadFile &bad) {
    return {StatusCode::kBadData, path + ": " + bad.what};
  } catch (const std::exception &) { // cv::Exception's own text is many lines of source positions
    return {StatusCode::kBadData, path + ": is not well-formed YAML or JSON; expected a rig file"};
  }
  if (Status s = validate (loaded); !s.ok ())
    return {s.code (), path + ": " + s.message ()};
  rig = std::move (loaded);
  return {};
}

Status
save_rig (const std::string &path, const Rig &rig)
{
  if (Status s = validate (rig); !s.ok ())
    return {s.code (), path + ": not written: " + s.message ()};
  if (Status s = check_extension (path, kRigExtensions); !s.ok ())
    return s;
  std::string text; /* OpenCV cannot say what is wrong with a file */
  try {
    cv::FileStorage file (path, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    file << "rangecast_rig" << kVersion;
    file.startWriteStruct ("views", cv::FileNode::SEQ);
    for (const View &view : rig.views)
      write_view (file, view);
    file.endWriteStruct ();
    text = file.releaseAndGetString ();
  } catch (const std::exception &e) {
    return {StatusCode::kBadValue, path + ": not written: " + e.what ()};
  }
  std::ofstream file (path, std::ios::binary);
  if (!file)
    return {StatusCode::kNotFound, path + ": cannot be opened for writing"};
  if (!file.write (text.data (), std::streamsize (text.size ())).flush ())
    return {StatusCode::kNoSpace, path + ": cannot be written to its end"};
  return {};
}

} // namespace rangecast
