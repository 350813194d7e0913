/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the core's tests share: where real data lies, images that own their pixels, sample rigs. */
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

namespace rangecast::testing {

/** RANGECAST_DATA, else ../shared/data beside the source tree; empty where neither is there. */
inline std::string
data_dir ()
{
  std::error_code error;
  if (const char *named = std::getenv ("RANGECAST_DATA"))
    return std::filesystem::is_directory (named, error) ? named : "";
  const char *source = std::getenv ("RANGECAST_SOURCE");
  const auto path = std::filesystem::path (source ? source : ".") / ".." / "shared" / "data";
  return std::filesystem::is_directory (path, error) ? path.string () : "";
}

#define RANGECAST_NEED_DATA(folder)                                                                \
  if (rangecast::testing::data_dir ().empty ())                                                    \
  GTEST_SKIP () << "no test data: set RANGECAST_DATA to the folder that holds " << (folder)

/** Pixels with an owner; rows are padded so that forgotten strides show. */
template <typename T> class Image {
public:
  Image (int width, int height, T fill = {}, int padding = 3)
      : stride_ (width + padding), width_ (width), height_ (height),
        pixels_ (static_cast<std::size_t> (stride_) * height, fill)
  {
  }
  ImageView<T> view ()
  {
    return {pixels_.data (), width_, height_, static_cast<std::ptrdiff_t> (stride_ * sizeof (T))};
  }

private:
  int stride_, width_, height_;
  std::vector<T> pixels_;
};

/** A pinhole range view of a camera `distance_m` from the world's origin, at `angle_deg` about the
 *  y axis (0: on +z), looking at the origin. */
inline View
ring_view (int id, double angle_deg, double distance_m = 0.8, int width = 320, int height = 240)
{
  View view;
  view.id = id;
  view.width = width;
  view.height = height;
  view.intrinsics = {double (width), double (width), (width - 1) / 2.0, (height - 1) / 2.0};
  const double a = angle_deg * M_PI / 180, s = std::sin (a), c = std::cos (a);
  /* Columns: the camera's x (right), y (down) and z (forward) axes in the world. */
  view.world_from_view.rotation = {c, 0, -s, 0, -1, 0, -s, 0, -c};
  view.world_from_view.translation = {s * distance_m, 0, c * distance_m};
  view.near_m = 0.3;
  view.far_m = 1.5;
  return view;
}

inline Rig
ring_rig (int views)
{
  Rig rig;
  for (int i = 0; i < views; i++)
    rig.views.push_back (ring_view (i, 360.0 * i / views));
  return rig;
}

} // namespace rangecast::testing
