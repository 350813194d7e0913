/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Makes a rig file of a stereo pair's calibration in another format: that of OpenCV's samples, a
 * Luxonis (OAK-D) factory calibration, or a Middlebury calib.txt. */
#include <glib.h>

#include <clocale>
#include <fstream>
#include <map>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/rigfile/yaml_tree.hpp>
#include <rangecast/stereo/rectification.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace {

using rangecast::Intrinsics;
using rangecast::PartnerCamera;
using rangecast::Pose;
using rangecast::Rig;
using rangecast::Status;
using rangecast::View;
using rangecast::YamlNode;

struct Options {
  gint view_id = 0;
  gchar *name = nullptr;
  gdouble near_m = 0, far_m = 0; /* 0: the format's, or the default */
  gdouble scale = 1;
  gchar *size = nullptr;
  gdouble unit_m = 1;
  gboolean append = FALSE;
  gchar **paths = nullptr;
};

/* An error for the user; thrown and caught in this file only. */
struct BadInput {
  std::string what;
  int exit_status = 1;
};

constexpr int kWrongUsage = 2;

/* Level at the world's origin, looking along -z with y up. */
const Pose kLevel = {{1, 0, 0, 0, -1, 0, 0, 0, -1}, {}};

/* To whole pixels, as pictures are scaled; rangecast::validate() says whether the size will do. */
void
scale_view (View &view, double scale)
{
  const int width = int (std::lround (view.width * scale)),
            height = int (std::lround (view.height * scale));
  const double sx = double (width) / view.width, sy = double (height) / view.height;
  view.width = width;
  view.height = height;
  view.intrinsics = view.intrinsics.scaled (sx, sy);
  view.right->intrinsics = view.right->intrinsics.scaled (sx, sy);
}

/* ---- files that OpenCV writes ---- */

constexpr std::uint64_t kMaxFileBytes = 16 << 20;

YamlNode
read_file (const std::string &path)
{
  YamlNode file;
  if (const Status s = rangecast::read_yaml (path, kMaxFileBytes, file); !s.ok ())
    throw BadInput{s.message ()};
  return file;
}

/* All numbers of a list, or of a list of lists. */
std::vector<double>
numbers_of (const YamlNode &node)
{
  if (node.type == YamlNode::Type::kNumber)
    return {*node.number ()};
  std::vector<double> values;
  for (const YamlNode &item : node.items)
    for (const double value : numbers_of (item))
      values.push_back (value);
  return values;
}

/* The files of one calibration. */
struct OpencvFiles : std::vector<YamlNode> {
  std::string names; /* for messages */
};

/* The numbers of a matrix with one of several names in one of the files.
 * @param count  0: any */
std::vector<double>
find_matrix (const OpencvFiles &files, std::initializer_list<const char *> names, const char *what,
    std::size_t count = 0)
{
  for (const YamlNode &file : files)
    for (const char *name : names)
      if (file[name].type == YamlNode::Type::kMap) {
        const std::vector<double> m = numbers_of (file[name]["data"]);
        if (count && m.size () != count)
          throw BadInput{std::string (name) + ": needs " + std::to_string (count) +
                         " numbers, got " + std::to_string (m.size ())};
        return m;
      }
  throw BadInput{files.names + ": no " + what + " (" + *names.begin () + ")"};
}

/* @param k  3 x 3, row by row */
Intrinsics
intrinsics_of (const std::vector<double> &k)
{
  return {k[0], k[4], k[2], k[5]};
}

Pose
pose_of (const std::vector<double> &r, const std::vector<double> &t, double unit_m)
{
  Pose pose;
  std::ranges::copy (r, pose.rotation.begin ());
  pose.translation = unit_m * rangecast::Vec3{t[0], t[1], t[2]};
  return pose;
}

void
read_size (const OpencvFiles &files, const Options &options, View &view)
{
  for (const YamlNode &file : files) {
    view.width = file["image_width"].integer ().value_or (view.width);
    view.height = file["image_height"].integer ().value_or (view.height);
  }
  char end = 0;
  if (options.size &&
      (std::sscanf (options.size, "%dx%d%c", &view.width, &view.height, &end) != 2 ||
          view.width < 1 || view.height < 1))
    throw BadInput{std::string ("--size: expected WIDTHxHEIGHT, e.g. 640x480, got ") + options.size,
        kWrongUsage};
  if (view.width < 1 || view.height < 1)
    throw BadInput{files.names +
                   ": no picture size (image_width, image_height): expected --size WIDTHxHEIGHT"};
}

/* Files of samples/cpp/stereo_calib.cpp: M1, D1, M2, D2 in one file, R, T in the other. */
View
read_opencv (const std::vector<std::string> &paths, const Options &options)
{
  OpencvFiles files;
  for (const std::string &path : paths) {
    files.push_back (read_file (path));
    files.names += (files.names.empty () ? "" : ", ") + path;
  }
  View view;
  read_size (files, options, view);
  view.intrinsics = intrinsics_of (find_matrix (
      files, {"M1", "K1", "cameraMatrix1", "camera_matrix_1"}, "left camera matrix", 9));
  view.distortion = find_matrix (files, {"D1", "distCoeffs1", "distortion_1"}, "left distortion");
  PartnerCamera right;
  right.intrinsics = intrinsics_of (find_matrix (
      files, {"M2", "K2", "cameraMatrix2", "camera_matrix_2"}, "right camera matrix", 9));
  right.distortion = find_matrix (files, {"D2", "distCoeffs2", "distortion_2"}, "right distortion");
  right.partner_from_left = pose_of (find_matrix (files, {"R"}, "rotation left to right", 9),
      find_matrix (files, {"T"}, "translation left to right", 3), options.unit_m);
  view.right = right;
  return view;
}

/* ---- Luxonis ---- */

const YamlNode &
luxonis_camera (const YamlNode &cameras, std::optional<int> socket)
{
  for (const YamlNode &entry : cameras.items)
    if (socket && entry.items.size () == 2 && entry.items[0].integer () == socket)
      return entry.items[1];
  throw BadInput{"no camera for socket " + std::to_string (socket.value_or (-1))};
}

Intrinsics
luxonis_intrinsics (const YamlNode &camera)
{
  const std::vector<double> k = numbers_of (camera["intrinsicMatrix"]);
  if (k.size () != 9)
    throw BadInput{"intrinsicMatrix: needs 3 x 3 numbers"};
  return intrinsics_of (k);
}

/* The stereo pair that stereoRectificationData names. Lengths are centimetres, distortion has 14
 * coefficients in OpenCV's order. */
View
read_luxonis (const std::vector<std::string> &paths, const Options &)
{
  const YamlNode file = read_file (paths[0]);
  const YamlNode &cameras = file["cameraData"], &pair = file["stereoRectificationData"];
  if (cameras.type != YamlNode::Type::kList || pair.type != YamlNode::Type::kMap)
    throw BadInput{"no Luxonis calibration: cameraData or stereoRectificationData is missing"};
  const std::optional<int> right_socket = pair["rightCameraSocket"].integer ();
  const YamlNode &left = luxonis_camera (cameras, pair["leftCameraSocket"].integer ());
  const YamlNode &right = luxonis_camera (cameras, right_socket);
  const YamlNode &extrinsics = left["extrinsics"];
  if (extrinsics["toCameraSocket"].integer () != right_socket)
    throw BadInput{"the left camera's extrinsics do not refer to the right one"};
  View view;
  view.width = left["width"].integer ().value_or (0);
  view.height = left["height"].integer ().value_or (0);
  view.intrinsics = luxonis_intrinsics (left);
  view.distortion = numbers_of (left["distortionCoeff"]);
  PartnerCamera partner;
  partner.intrinsics = luxonis_intrinsics (right);
  partner.distortion = numbers_of (right["distortionCoeff"]);
  const std::vector<double> r = numbers_of (extrinsics["rotationMatrix"]);
  const YamlNode &t = extrinsics["translation"];
  const auto x = t["x"].number (), y = t["y"].number (), z = t["z"].number ();
  if (r.size () != 9 || !x || !y || !z)
    throw BadInput{"extrinsics: needs rotationMatrix, 3 x 3, and translation"};
  partner.partner_from_left = pose_of (r, {*x, *y, *z}, 0.01);
  view.right = partner;
  view.near_m = 1;
  view.far_m = 6;
  return view;
}

/* ---- Middlebury ---- */

using Values = std::map<std::string, std::vector<double>>;

/* Lines of name=number or name=[a b c; d e f; g h i]. */
Values
read_values (const std::string &path)
{
  std::ifstream file (path);
  if (!file)
    throw BadInput{path + ": cannot be read"};
  Values values;
  for (std::string line; std::getline (file, line);) {
    const std::size_t equals = line.find ('=');
    if (equals == std::string::npos)
      continue;
    std::string rest = line.substr (equals + 1);
    for (char &c : rest)
      if (c == '[' || c == ']' || c == ';' || c == ',')
        c = ' ';
    std::istringstream numbers (rest);
    for (double v; numbers >> v;)
      values[line.substr (0, equals)].push_back (v);
  }
  return values;
}

std::vector<double>
value_of (const Values &values, const char *name, std::size_t count)
{
  const auto found = values.find (name);
  if (found == values.end () || found->second.size () != count)
    throw BadInput{std::string (name) + ": expected " + std::to_string (count) +
                   " numbers, as in Middlebury's calib.txt"};
  return found->second;
}

int
side_of (const Values &values, const char *name)
{
  const double side = value_of (values, name, 1)[0];
  if (!(side >= 1 && side <= rangecast::kMaxImageSide))
    throw BadInput{std::string (name) + ": expected 1 to " +
                   std::to_string (rangecast::kMaxImageSide) + " pixels"};
  return int (side);
}

/* Rectified pairs; the baseline is in millimetres, disparities lie between vmin and vmax, or below
 * ndisp. */
View
read_middlebury (const std::vector<std::string> &paths, const Options &)
{
  const Values values = read_values (paths[0]);
  const auto left = value_of (values, "cam0", 9), right = value_of (values, "cam1", 9);
  View view;
  view.width = side_of (values, "width");
  view.height = side_of (values, "height");
  view.intrinsics = {left[0], left[4], left[2], left[5]};
  PartnerCamera partner;
  partner.intrinsics = {right[0], right[4], right[2], right[5]};
  const double baseline_m = value_of (values, "baseline", 1)[0] / 1000;
  partner.partner_from_left.translation = {-baseline_m, 0, 0};
  view.right = partner;
  const double offset = right[2] - left[2];
  const auto depth_at = [&] (double disparity) {
    return left[0] * baseline_m / (disparity + offset);
  };
  const bool has_range = values.contains ("vmin") && values.contains ("vmax");
  if (has_range || values.contains ("ndisp")) {
    view.near_m = depth_at (value_of (values, has_range ? "vmax" : "ndisp", 1)[0]);
    view.far_m = has_range ? depth_at (value_of (values, "vmin", 1)[0]) : 10 * view.near_m;
  }
  return view;
}

/* ---- all of them ---- */

struct Format {
  const char *name;
  std::size_t min_inputs, max_inputs;
  View (*read) (const std::vector<std::string> &paths, const Options &options);
};
const Format kFormats[] = {{"opencv", 1, 2, read_opencv}, {"luxonis", 1, 1, read_luxonis},
    {"middlebury", 1, 1, read_middlebury}};

void
check (const Status &status, const std::string &about = "")
{
  if (!status.ok ())
    throw BadInput{about + status.message ()};
}

/* All messages begin with the file or the option. */
View
read_named (const Format &format, const std::vector<std::string> &paths, const Options &options)
{
  try {
    return format.read (paths, options);
  } catch (const BadInput &bad) {
    if (bad.exit_status == kWrongUsage || bad.what.starts_with (paths[0]) ||
        bad.what.starts_with (paths.back ()))
      throw;
    throw BadInput{paths[0] + ": " + bad.what};
  } catch (
      const std::exception &) { /* cv::Exception's own text is many lines of source positions */
    throw BadInput{paths[0] + ": does not match the format; see docs/formats/rig.md"};
  }
}

/* T may be in board squares, centimetres or millimetres instead of metres. */
void
warn_if_wide (const View &view)
{
  constexpr double kWideM = 1;
  const double baseline_m = norm (view.right->partner_from_left.translation);
  if (baseline_m > kWideM)
    g_printerr ("rig-convert: warning: the baseline is %.3g m; is the unit of T really metres? See "
                "--unit\n",
        baseline_m);
}

void
convert (const Options &options)
{
  std::vector<std::string> words;
  for (gchar **path = options.paths; path && *path; path++)
    words.emplace_back (*path);
  const auto format = std::ranges::find_if (
      kFormats, [&] (const Format &f) { return !words.empty () && words[0] == f.name; });
  if (format == std::end (kFormats))
    throw BadInput{"expected a format: opencv, luxonis or middlebury; see --help", kWrongUsage};
  if (words.size () < format->min_inputs + 2 || words.size () > format->max_inputs + 2)
    throw BadInput{std::string (format->name) + ": expected calibration files and RIG; see --help",
        kWrongUsage};
  if (!(options.scale > 0 && options.scale <= 1000) || !(options.unit_m > 0))
    throw BadInput{
        "--scale and --unit: expected numbers above 0, and --scale at most 1000", kWrongUsage};

  const std::string rig_path = words.back ();
  const std::vector<std::string> paths (words.begin () + 1, words.end () - 1);
  View view = read_named (*format, paths, options);
  view.id = options.view_id;
  view.name = options.name ? options.name : "";
  view.world_from_view = kLevel;
  view.near_m = options.near_m > 0 ? options.near_m : view.near_m;
  view.far_m = options.far_m > 0 ? options.far_m : view.far_m;
  while (view.far_m > 65535 * view.depth_unit_m)
    view.depth_unit_m *= 10;
  scale_view (view, options.scale);
  Rig rig;
  if (options.append)
    check (rangecast::load_rig (rig_path, rig));
  if (rig.find (view.id))
    throw BadInput{rig_path + " already has view " + std::to_string (view.id) +
                   ": expected another --view-id"};
  check (rangecast::merge (rig, {{view}}), rig_path + ": ");
  check (rangecast::validate (rig), paths.back () + ": ");
  rangecast::Rectifier rectifier; /* says what stereodepth would say */
  check (rectifier.set (view), paths.back () + ": ");
  warn_if_wide (view);
  check (rangecast::save_rig (rig_path, rig));
}

bool
parse_arguments (int *argc, char ***argv, Options &options)
{
  const GOptionEntry entries[] = {
      {"view-id", 0, 0, G_OPTION_ARG_INT, &options.view_id, "View-id, 0 to 63 (default 0)", "N"},
      {"name", 0, 0, G_OPTION_ARG_STRING, &options.name, "Name of the view (default: none)",
          "TEXT"},
      {"near", 0, 0, G_OPTION_ARG_DOUBLE, &options.near_m,
          "Nearest depth of interest, metres (default: the format's, or 0.3; luxonis 1)", "M"},
      {"far", 0, 0, G_OPTION_ARG_DOUBLE, &options.far_m,
          "Farthest depth of interest, metres (default: the format's, or 3; luxonis 6)", "M"},
      {"scale", 0, 0, G_OPTION_ARG_DOUBLE, &options.scale,
          "Factor by which pictures are scaled before stereodepth (default 1)", "S"},
      {"size", 0, 0, G_OPTION_ARG_STRING, &options.size,
          "opencv: size of the calibration pictures, if it is not in the files", "WxH"},
      {"unit", 0, 0, G_OPTION_ARG_DOUBLE, &options.unit_m,
          "opencv: unit of T in metres, which is that of the board's squares (default 1)", "M"},
      {"append", 0, 0, G_OPTION_ARG_NONE, &options.append, "Add the view to the rig file", nullptr},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &options.paths, nullptr, nullptr},
      {}};
  GOptionContext *context = g_option_context_new ("FORMAT CALIBRATION... RIG");
  g_option_context_set_summary (context,
      "Makes a rig file of a calibrated stereo pair. The left camera is at the world's origin,\n"
      "level, looking along -z with y up.\n"
      "  rig-convert opencv INTRINSICS.yml EXTRINSICS.yml RIG  M1, D1, M2, D2, R, T "
      "(stereo_calib)\n"
      "  rig-convert luxonis CALIB.json RIG                    factory calibration of an OAK-D\n"
      "  rig-convert middlebury CALIB.txt RIG                  cam0, cam1, baseline, width, "
      "height");
  g_option_context_add_main_entries (context, entries, nullptr);
  GError *error = nullptr;
  const bool parsed = g_option_context_parse (context, argc, argv, &error);
  if (!parsed)
    g_printerr ("rig-convert: %s\n", error->message);
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed;
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Options options;
  int status = 0;
  if (!parse_arguments (&argc, &argv, options))
    return kWrongUsage;
  try {
    convert (options);
  } catch (const BadInput &bad) {
    g_printerr ("rig-convert: %s\n", bad.what.c_str ());
    status = bad.exit_status;
  } catch (
      const std::exception &) { /* cv::Exception's own text is many lines of source positions */
    g_printerr (
        "rig-convert: the calibration does not match its format; see docs/formats/rig.md\n");
    status = 1;
  }
  g_free (options.name);
  g_free (options.size);
  g_strfreev (options.paths);
  return status;
}
