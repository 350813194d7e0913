/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as a glTF file, JSON or binary: refused, or a model whose indices name what is there.
 */
#include <cstdlib>
#include <rangecast/scene/gltf.hpp>

#include "memory_file.hpp"

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
#ifdef RANGECAST_HAVE_ASSIMP
  static const MemoryFile file ("model.gltf");
  file.fill ({data, size});
  rangecast::Model model;
  if (!rangecast::read_gltf (file.path (), model).ok ())
    return 0;
  if (model.meshes.size () != model.materials.size ())
    std::abort ();
  for (const int material : model.materials)
    if (material >= int (model.palette.size ()))
      std::abort ();
  for (const auto &material : model.palette)
    if (material.picture >= int (model.pictures.size ()))
      std::abort ();
  for (const auto &mesh : model.meshes) {
    if (!mesh.colours.empty () && mesh.colours.size () != mesh.vertices.size ())
      std::abort ();
    for (const auto &triangle : mesh.triangles)
      for (const auto index : triangle)
        if (index >= mesh.vertices.size ())
          std::abort ();
  }
#else
  (void)data, (void)size;
#endif
  return 0;
}
