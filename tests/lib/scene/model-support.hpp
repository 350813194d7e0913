/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests of models share: files in a folder that goes with the test, what a view shows of a
 * model. */
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <rangecast/scene/model.hpp>
#include <rangecast/scene/scene.hpp>
#include <unistd.h>

#include "../test-support.hpp"
#include "glb-writer.hpp"

namespace rangecast::testing {

/* A folder that goes with the test. */
class Folder {
public:
  Folder ()
      : path_ (std::filesystem::path (::testing::TempDir ()) /
               ("model-" + std::to_string (getpid ()) + "-" + std::to_string (count_++)))
  {
    std::filesystem::create_directories (path_);
  }
  ~Folder () { std::filesystem::remove_all (path_); }

  [[nodiscard]] std::string path (const std::string &name) const
  {
    return (path_ / name).string ();
  }
  [[nodiscard]] std::string write (const std::string &name, const std::string &bytes) const
  {
    std::ofstream (path (name), std::ios::binary) << bytes;
    return path (name);
  }

private:
  static inline int count_ = 0;
  std::filesystem::path path_;
};

inline std::vector<std::uint8_t>
png (int width, int height, std::initializer_list<Rgbx> pixels)
{
  cv::Mat picture (height, width, CV_8UC4);
  int i = 0;
  for (const Rgbx p : pixels)
    picture.at<cv::Vec4b> (i / width, i % width) = {p.b, p.g, p.r, p.x}, i++;
  std::vector<std::uint8_t> bytes;
  cv::imencode (".png", picture, bytes);
  return bytes;
}

inline std::vector<std::uint8_t>
plain_png (Rgbx colour)
{
  return png (1, 1, {colour});
}

inline constexpr Rgbx kRed{200, 0, 0, 255}, kGreen{0, 200, 0, 255}, kBlue{0, 0, 200, 255},
    kWhite{200, 200, 200, 255};

inline Status
load (const std::string &path, Figure &figure, double top_m = kTopAll)
{
  return load_model ({path, top_m}, figure);
}

inline Status
load (const GlbWriter &glb, Figure &figure, double top_m = kTopAll)
{
  const Folder folder;
  return load (folder.write ("model.glb", glb.glb ()), figure, top_m);
}

/* What a view of a model shows. */
class RenderedModel {
public:
  explicit RenderedModel (const std::string &path, int view = 0)
  {
    SceneSettings settings;
    settings.model = path;
    settings.model_top_m = kTopAll;
    settings.motion = settings.noise_sigma = 0;
    std::unique_ptr<Scene> scene;
    Status status = Scene::create (settings, scene);
    EXPECT_TRUE (status.ok ()) << status.message ();
    if (status.ok ())
      status = scene->render (
          view, SceneCamera::kLeft, 0, false, colour_.view (), depth_.view (), mask_.view ());
    EXPECT_TRUE (status.ok ()) << status.message ();
  }

  /* "red", "green", "blue", "white", "other" of the figure, or "room", at a place of the fitted
   * model. */
  std::string at (double x, double y, double z = 0)
  {
    const auto [u, v] = pixel (x, y, z);
    if (!mask_.view ().at (u, v))
      return "room";
    const Rgbx p = colour_.view ().at (u, v);
    const auto bright = [] (int c) { return c > 120; };
    const auto dark = [] (int c) { return c < 40; };
    if (bright (p.r) && bright (p.g) && bright (p.b))
      return "white";
    if (bright (p.r) && dark (p.g) && dark (p.b))
      return "red";
    if (dark (p.r) && bright (p.g) && dark (p.b))
      return "green";
    return dark (p.r) && dark (p.g) && bright (p.b) ? "blue" : "other";
  }

  Rgbx colour (double x, double y)
  {
    const auto [u, v] = pixel (x, y, 0);
    return colour_.view ().at (u, v);
  }

  int covered ()
  {
    int n = 0;
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++)
        n += mask_.view ().at (x, y);
    return n;
  }

private:
  static std::pair<int, int> pixel (double x, double y, double z)
  {
    return {int (std::lround (159.5 + 320 * x / (0.8 - z))),
        int (std::lround (119.5 - 320 * y / (0.8 - z)))};
  }

  Image<Rgbx> colour_{320, 240};
  Image<std::uint16_t> depth_{320, 240};
  Image<std::uint8_t> mask_{320, 240};
};

inline RenderedModel
rendered (const GlbWriter &glb, int view = 0)
{
  const Folder folder;
  return RenderedModel (folder.write ("model.glb", glb.glb ()), view);
}

inline GlbWriter
red_square (const std::string &material_more = "")
{
  GlbWriter glb;
  glb.add_mesh_node (glb.add_square (
      0, 0, 0, 1, glb.add_textured_material (glb.add_texture (plain_png (kRed)), material_more)));
  return glb;
}

} // namespace rangecast::testing
