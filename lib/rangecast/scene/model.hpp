/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>

#include "../status.hpp"
#include "mesh.hpp"

namespace rangecast {

/** Loads a textured figure, and scales and centres it as fit_figure() says.
 *  @param path     glTF (.glb, .gltf), OBJ or whatever else assimp reads
 *  @param texture  JPEG or PNG; empty: the one that the material names, else a picture beside the
 *                  model whose name says that it is a colour map, else plain skin
 *  @param flip     turn the texture upside down, for a picture drawn for v the other way round
 *  @return kNotFound or kBadData naming the file; kUnsupported in a build without assimp */
Status load_model (const std::string &path, const std::string &texture, bool flip, Mesh &mesh);

} // namespace rangecast
