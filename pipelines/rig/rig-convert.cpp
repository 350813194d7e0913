/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Makes a rig file of a stereo pair's calibration in another format: what OpenCV's samples write, a
 * Luxonis (OAK-D) factory calibration, or a Middlebury calib.txt. */
#include <glib.h>

#include <clocale>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/roi/storage_check.hpp>
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

/* Thrown and caught in this file only: what is wrong, for the user. */
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

/* ---- files that OpenCV reads ---- */

cv::FileStorage
open_storage (const std::string &path)
{
  if (const rangecast::Status s = rangecast::check_storage (path); !s.ok ())
    throw BadInput{s.message ()};
  cv::FileStorage file;
  try {
    if (std::ifstream (path).good () && file.open (path, cv::FileStorage::READ))
      return file;
  } catch (const cv::Exception &) {
  }
  throw BadInput{path + ": cannot be read as YAML or JSON"};
}

/* The files of one calibration. */
struct OpencvFiles : std::vector<cv::FileStorage> {
  std::string names; /* for messages */
};

/* A matrix that goes by one of several names in one of the files. */
cv::Mat
find_matrix (const OpencvFiles &files, std::initializer_list<const char *> names, const char *what)
{
  for (const cv::FileStorage &file : files)
    for (const char *name : names)
      if (const cv::FileNode node = file[name]; node.isMap ()) {
        cv::Mat m;
        node.mat ().convertTo (m, CV_64F);
        return m;
      }
  throw BadInput{files.names + ": no " + what + " (" + *names.begin () + ")"};
}

Intrinsics
intrinsics_of (const cv::Mat &k)
{
  if (k.rows != 3 || k.cols != 3)
    throw BadInput{"a camera matrix is not 3 x 3"};
  return {k.at<double> (0, 0), k.at<double> (1, 1), k.at<double> (0, 2), k.at<double> (1, 2)};
}

rangecast::Distortion
distortion_of (const cv::Mat &d)
{
  return {d.begin<double> (), d.end<double> ()};
}

Pose
pose_of (const cv::Mat &r, const cv::Mat &t, double unit_m)
{
  if (r.rows != 3 || r.cols != 3 || t.total () != 3)
    throw BadInput{"R and T: expected 3 x 3 and 3 x 1"};
  Pose pose;
  std::copy (r.begin<double> (), r.end<double> (), pose.rotation.begin ());
  const auto at = t.begin<double> ();
  pose.translation = unit_m * rangecast::Vec3{at[0], at[1], at[2]};
  return pose;
}

void
read_size (const OpencvFiles &files, const Options &options, View &view)
{
  for (const cv::FileStorage &file : files)
    if (file["image_width"].isInt () && file["image_height"].isInt ()) {
      view.width = int (file["image_width"]);
      view.height = int (file["image_height"]);
    }
  char end = 0;
  if (options.size &&
      (std::sscanf (options.size, "%dx%d%c", &view.width, &view.height, &end) != 2 ||
          view.width < 1 || view.height < 1))
    throw BadInput{std::string ("--size: expected WIDTHxHEIGHT, e.g. 640x480, got ") + options.size,
        kWrongUsage};
  if (view.width < 1 || view.height < 1)
    throw BadInput{files.names +
                   ": the pictures' size is not there (image_width, image_height): expected "
                   "--size WIDTHxHEIGHT"};
}

/* What samples/cpp/stereo_calib.cpp writes: M1, D1, M2, D2 in one file, R, T in the other. */
View
read_opencv (const std::vector<std::string> &paths, const Options &options)
{
  OpencvFiles files;
  for (const std::string &path : paths) {
    files.push_back (open_storage (path));
    files.names += (files.names.empty () ? "" : ", ") + path;
  }
  View view;
  read_size (files, options, view);
  view.intrinsics = intrinsics_of (
      find_matrix (files, {"M1", "K1", "cameraMatrix1", "camera_matrix_1"}, "left camera matrix"));
  view.distortion =
      distortion_of (find_matrix (files, {"D1", "distCoeffs1", "distortion_1"}, "left distortion"));
  PartnerCamera right;
  right.intrinsics = intrinsics_of (
      find_matrix (files, {"M2", "K2", "cameraMatrix2", "camera_matrix_2"}, "right camera matrix"));
  right.distortion = distortion_of (
      find_matrix (files, {"D2", "distCoeffs2", "distortion_2"}, "right distortion"));
  right.partner_from_left = pose_of (find_matrix (files, {"R"}, "rotation left to right"),
      find_matrix (files, {"T"}, "translation left to right"), options.unit_m);
  view.right = right;
  return view;
}

/* ---- Luxonis ---- */

std::vector<double>
numbers_of (const cv::FileNode &node)
{
  std::vector<double> values;
  for (const cv::FileNode &item : node)
    if (item.isSeq ())
      for (const cv::FileNode &inner : item)
        values.push_back (inner.real ());
    else
      values.push_back (item.real ());
  return values;
}

cv::FileNode
luxonis_camera (const cv::FileNode &cameras, int socket)
{
  for (const cv::FileNode &entry : cameras)
    if (entry.isSeq () && entry.size () == 2 && entry[0].isInt () && int (entry[0]) == socket)
      return entry[1];
  throw BadInput{"no camera of socket " + std::to_string (socket)};
}

Intrinsics
luxonis_intrinsics (const cv::FileNode &camera)
{
  const std::vector<double> k = numbers_of (camera["intrinsicMatrix"]);
  if (k.size () != 9)
    throw BadInput{"intrinsicMatrix: expected 3 x 3 numbers"};
  return {k[0], k[4], k[2], k[5]};
}

/* The stereo pair that stereoRectificationData names. Lengths are centimetres, distortion has 14
 * coefficients in OpenCV's order. */
View
read_luxonis (const std::vector<std::string> &paths, const Options &)
{
  const cv::FileStorage file = open_storage (paths[0]);
  const cv::FileNode cameras = file["cameraData"], pair = file["stereoRectificationData"];
  if (!cameras.isSeq () || !pair.isMap ())
    throw BadInput{"expected a Luxonis calibration with cameraData and stereoRectificationData"};
  const int right_socket = int (pair["rightCameraSocket"]);
  const cv::FileNode left = luxonis_camera (cameras, int (pair["leftCameraSocket"]));
  const cv::FileNode right = luxonis_camera (cameras, right_socket);
  const cv::FileNode extrinsics = left["extrinsics"];
  if (int (extrinsics["toCameraSocket"]) != right_socket)
    throw BadInput{"the left camera's extrinsics do not lead to the right one"};
  View view;
  view.width = int (left["width"]);
  view.height = int (left["height"]);
  view.intrinsics = luxonis_intrinsics (left);
  view.distortion = numbers_of (left["distortionCoeff"]);
  PartnerCamera partner;
  partner.intrinsics = luxonis_intrinsics (right);
  partner.distortion = numbers_of (right["distortionCoeff"]);
  const std::vector<double> r = numbers_of (extrinsics["rotationMatrix"]);
  const cv::FileNode t = extrinsics["translation"];
  if (r.size () != 9 || !t.isMap ())
    throw BadInput{"extrinsics: expected rotationMatrix, 3 x 3, and translation"};
  std::ranges::copy (r, partner.partner_from_left.rotation.begin ());
  partner.partner_from_left.translation =
      0.01 * rangecast::Vec3{t["x"].real (), t["y"].real (), t["z"].real ()};
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
                   " numbers, as Middlebury's calib.txt has"};
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

/* Whatever is wrong, the message begins with the file or the option. */
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
    throw BadInput{paths[0] + ": is not what the format has; see docs/formats/rig.md"};
  }
}

/* Lengths in board squares, centimetres or millimetres that were taken for metres. */
void
warn_if_wide (const View &view)
{
  constexpr double kWideM = 1;
  const double baseline_m = norm (view.right->partner_from_left.translation);
  if (baseline_m > kWideM)
    g_printerr ("rig-convert: warning: the cameras stand %.3g m apart; is a T of 1 really a metre? "
                "See --unit\n",
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
    throw BadInput{
        std::string (format->name) + ": expected its calibration and RIG; see --help", kWrongUsage};
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
      {"view-id", 0, 0, G_OPTION_ARG_INT, &options.view_id, "0 to 63 (default 0)", "N"},
      {"name", 0, 0, G_OPTION_ARG_STRING, &options.name, "Of the view (default none)", "TEXT"},
      {"near", 0, 0, G_OPTION_ARG_DOUBLE, &options.near_m,
          "Nearest depth of interest, metres (default: the format's, or 0.3; luxonis 1)", "M"},
      {"far", 0, 0, G_OPTION_ARG_DOUBLE, &options.far_m,
          "Farthest (default: the format's, or 3; luxonis 6)", "M"},
      {"scale", 0, 0, G_OPTION_ARG_DOUBLE, &options.scale,
          "By which pictures are scaled before stereodepth (default 1)", "S"},
      {"size", 0, 0, G_OPTION_ARG_STRING, &options.size,
          "opencv: of the pictures that were calibrated, if the files do not say", "WxH"},
      {"unit", 0, 0, G_OPTION_ARG_DOUBLE, &options.unit_m,
          "opencv: metres that a T of 1 is: the unit of the board's squares (default 1)", "M"},
      {"append", 0, 0, G_OPTION_ARG_NONE, &options.append, "Add the view to the rig file", nullptr},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &options.paths, nullptr, nullptr},
      {}};
  GOptionContext *context = g_option_context_new ("FORMAT CALIBRATION... RIG");
  g_option_context_set_summary (context,
      "Makes a rig file of a calibrated stereo pair. The left camera is put at the world's "
      "origin,\n"
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
        "rig-convert: the calibration is not what its format has; see docs/formats/rig.md\n");
    status = 1;
  }
  g_free (options.name);
  g_free (options.size);
  g_strfreev (options.paths);
  return status;
}
