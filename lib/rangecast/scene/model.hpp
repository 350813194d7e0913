/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

#include "../base/status.hpp"
#include "mesh.hpp"

namespace rangecast {

struct ModelSettings {
  std::string path;             ///< glTF (.glb, .gltf) or OBJ
  double top_m = kTopAutomatic; ///< see fit_figure()
};

/** Loads a textured figure, and scales and centres it as fit_figure() says. Where no material names
 *  a picture, one beside a model of one material is its texture if its name says that it is a
 *  colour map.
 *  @return kNotFound, kBadData or kUnsupported naming the file; kUnsupported in a build without
 *          models */
Status load_model (const ModelSettings &settings, Figure &figure);

} // namespace rangecast
