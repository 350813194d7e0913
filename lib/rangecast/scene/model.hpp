/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "../base/status.hpp"
#include "mesh.hpp"

namespace rangecast {

struct ModelSettings {
  std::string path;             ///< glTF 2.0
  double top_m = kTopAutomatic; ///< see fit_figure()
};

/** Loads a textured figure, and scales and centres it as fit_figure() says. Where no material names
 *  a picture, one beside a model of one material is its texture if its name says that it is a
 *  colour map.
 *  @return kNotFound, kBadData or kUnsupported naming the file; kUnsupported in a build without
 *          models */
Status load_model (const ModelSettings &settings, Figure &figure);

/** An image of a model, JPEG or PNG. */
struct ModelPicture {
  std::string name;                ///< path, or what an error calls it
  std::vector<std::uint8_t> bytes; ///< of an embedded one; empty: read the file `name`
};

struct ModelMaterial {
  int picture = -1;                            ///< index, -1: none
  std::array<double, 4> factor = {1, 1, 1, 1}; ///< R, G, B as displayed, and alpha
  bool has_colour = false;                     ///< names a factor or a picture
  bool masked = false;                         ///< alpha counts
  double alpha_cutoff = 0.5;
  bool double_sided = false;
  bool visible = true;                                  ///< false: light passes through most of it
  int coordinates = 0;                                  ///< which set of texture coordinates
  std::array<double, 6> transform = {1, 0, 0, 0, 1, 0}; ///< of texture coordinates, 2 x 3
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
};

/** A model as its file describes it: meshes in the file's own units, without textures. */
struct Model {
  std::vector<Mesh> meshes;
  std::vector<int> materials; ///< of each mesh, index into `palette`, -1: none
  std::vector<ModelMaterial> palette;
  std::vector<ModelPicture> pictures;
};

/** More than any scan that a software rasteriser could draw live. */
inline constexpr std::size_t kMaxModelVertices = 4'000'000, kMaxModelTriangles = 8'000'000;

/** Reads a glTF 2.0 file, JSON or binary: all meshes of its scene with their nodes' transforms, and
 *  skins in the pose of the joints' nodes. Indices, offsets and lengths are checked here: tinygltf
 *  copies them from the file.
 *  @return kBadData or kTruncated for what is not glTF; kUnsupported naming the extension */
Status read_gltf (const std::string &path, Model &model);

} // namespace rangecast
