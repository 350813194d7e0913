/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

#include "../base/status.hpp"
#include "mesh.hpp"

namespace rangecast {

struct ModelSettings {
  std::string path;    ///< glTF (.glb, .gltf), OBJ or whatever else assimp reads
  std::string texture; ///< JPEG or PNG for all meshes; empty: what each material names, else a
                       ///< picture beside a model of one material whose name says that it is a
                       ///< colour map, else plain skin
  bool texture_flip = false;    ///< turn textures upside down
  double top_m = kTopAutomatic; ///< see fit_figure()
};

/** Loads a textured figure, and scales and centres it as fit_figure() says.
 *  @return kNotFound, kBadData or kUnsupported naming the file; kUnsupported in a build without
 *          assimp */
Status load_model (const ModelSettings &settings, Figure &figure);

} // namespace rangecast
