/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The file form of a rig; the layout is described in docs/formats/rig.md. */
#include "rig_file.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>

#include "rig_text.hpp"
#include "yaml_tree.hpp"

namespace rangecast {
namespace {

/* Thrown and caught in this file only: what is wrong with the file's contents. */
struct BadFile {
  std::string what;
};

std::vector<double>
numbers (const YamlNode &node, const std::string &name, std::size_t count)
{
  std::vector<double> values;
  if (node.type != YamlNode::Type::kList)
    throw BadFile{name + ": is no list of numbers"};
  for (const YamlNode &item : node.items) {
    const std::optional<double> value = item.number ();
    if (!value)
      throw BadFile{name + ": has something that is no number"};
    values.push_back (*value);
  }
  if (count && values.size () != count)
    throw BadFile{name + ": must have " + std::to_string (count) + " numbers, has " +
                  std::to_string (values.size ())};
  return values;
}

double
number (const YamlNode &parent, const std::string &name, double default_value)
{
  const YamlNode &node = parent[name];
  if (node.type == YamlNode::Type::kNone)
    return default_value;
  const std::optional<double> value = node.number ();
  if (!value)
    throw BadFile{name + ": is no number"};
  return *value;
}

Pose
read_pose (const YamlNode &parent, const std::string &name)
{
  const YamlNode &node = parent[name];
  if (node.type != YamlNode::Type::kMap)
    throw BadFile{name + ": is no map with rotation and translation"};
  Pose pose;
  const auto r = numbers (node["rotation"], name + ".rotation", 9);
  std::copy (r.begin (), r.end (), pose.rotation.begin ());
  const auto t = numbers (node["translation"], name + ".translation", 3);
  pose.translation = {t[0], t[1], t[2]};
  return pose;
}

void
read_lens (const YamlNode &node, Intrinsics &intrinsics, Distortion &distortion)
{
  const auto k = numbers (node["intrinsics"], "intrinsics", 4);
  intrinsics = {k[0], k[1], k[2], k[3]};
  if (node["distortion"].type != YamlNode::Type::kNone)
    distortion = numbers (node["distortion"], "distortion", 0);
}

/* A serial number without quotes is a number to YAML, and may have lost digits. */
std::string
read_camera (const YamlNode &parent)
{
  const YamlNode &node = parent["camera"];
  if (node.type == YamlNode::Type::kNone)
    return {};
  if (node.type != YamlNode::Type::kText)
    throw BadFile{"camera: is no text (put a serial number in quotes)"};
  return node.text;
}

std::optional<PartnerCamera>
read_partner (const YamlNode &parent, const char *name)
{
  const YamlNode &node = parent[name];
  if (node.type == YamlNode::Type::kNone)
    return {};
  if (node.type != YamlNode::Type::kMap)
    throw BadFile{std::string (name) + ": is no map"};
  PartnerCamera partner;
  partner.camera = read_camera (node);
  read_lens (node, partner.intrinsics, partner.distortion);
  partner.partner_from_left = read_pose (node, "partner_from_left");
  return partner;
}

View
read_view (const YamlNode &node)
{
  if (node.type != YamlNode::Type::kMap)
    throw BadFile{"is no map"};
  View view;
  const std::optional<int> id = node["id"].integer ();
  if (!id || *id < 0 || *id >= kMaxViews)
    throw BadFile{"id: must be an integer from 0 to " + std::to_string (kMaxViews - 1)};
  view.id = *id;
  if (node["name"].type == YamlNode::Type::kText)
    view.name = node["name"].text;
  view.camera = read_camera (node);
  const auto size = numbers (node["image_size"], "image_size", 2);
  for (double side : size)
    if (!(side >= 1 && side <= kMaxImageSide && side == std::floor (side)))
      throw BadFile{
          "image_size: must be whole numbers from 1 to " + std::to_string (kMaxImageSide)};
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
read_rig (const YamlNode &file)
{
  const std::optional<int> version = file["rangecast_rig"].integer ();
  if (!version)
    throw BadFile{
        "no \"rangecast_rig\" version: this is not a rig file; `rangecast import` makes one of "
        "other calibrations"};
  if (*version != kRigFileVersion)
    throw BadFile{"rangecast_rig version " + std::to_string (*version) + ", not " +
                  std::to_string (kRigFileVersion)};
  const YamlNode &views = file["views"];
  if (views.type != YamlNode::Type::kList)
    throw BadFile{"views: is no list"};
  Rig rig;
  for (const YamlNode &node : views.items) {
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

} // namespace

Status
load_rig (const std::string &path, Rig &rig)
{
  std::error_code error;
  const std::filesystem::file_status there = std::filesystem::status (path, error);
  if (!std::filesystem::exists (there))
    return {StatusCode::kNotFound, path + ": no such rig file"};
  if (!std::filesystem::is_regular_file (there))
    return {StatusCode::kNotFound, path + ": is a folder or a device, no rig file"};
  if (std::filesystem::file_size (path, error) > kMaxRigFileSize || error)
    return {StatusCode::kBadData, path + ": is larger than 4 MiB"};
  YamlNode file;
  if (Status s = read_yaml (path, kMaxRigFileSize, file); !s.ok ())
    return {s.code (), s.message () + "; is it a rig file?"};
  Rig loaded;
  try {
    loaded = read_rig (file);
  } catch (const BadFile &bad) {
    return {StatusCode::kBadData, path + ": " + bad.what};
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
  const std::string text = rig_text (rig, path.ends_with (".json"));
  std::ofstream file (path, std::ios::binary);
  if (!file)
    return {StatusCode::kNotFound, path + ": cannot be opened for writing"};
  if (!file.write (text.data (), std::streamsize (text.size ())).flush ())
    return {StatusCode::kNoSpace, path + ": cannot be written to its end"};
  return {};
}

} // namespace rangecast
