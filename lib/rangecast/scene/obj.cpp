/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "model.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <algorithm>
#include <filesystem>
#include <map>
#include <tiny_obj_loader.h>
#include <tuple>

#include "pattern.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

/* Where a material's picture is: exporters on other machines write their own path. */
std::string
picture_path (const std::string &model, std::string text)
{
  std::ranges::replace (text, '\\', '/'); /* as programs on Windows write it */
  const fs::path folder = fs::path (model).parent_path (), path = text;
  std::error_code error;
  const bool beside =
      !fs::exists (folder / path, error) && fs::exists (folder / path.filename (), error);
  return (folder / (beside ? path.filename () : path)).string ();
}

Rgbx
byte_colour (const float *c)
{
  const auto byte = [&] (int i) { return c[i] > 0 ? to_byte (255 * double (c[i])) : 0; };
  return {std::uint8_t (byte (0)), std::uint8_t (byte (1)), std::uint8_t (byte (2)), 255};
}

ModelMaterial
material_of (const tinyobj::material_t &from, const std::string &path, Model &model)
{
  ModelMaterial material;
  material.double_sided = true; /* OBJ has no flag for it, and leaves sheets open */
  material.has_colour = true;
  material.visible = from.dissolve >= 0.5f;
  if (from.diffuse_texname.empty ()) {
    std::copy_n (from.diffuse, 3, material.factor.begin ());
    return material;
  }
  /* exporters leave any colour beside a picture */
  material.picture = int (model.pictures.size ());
  model.pictures.push_back ({picture_path (path, from.diffuse_texname), {}});
  material.masked = from.alpha_texname == from.diffuse_texname;
  if (from.diffuse_texopt.clamp)
    material.wrap_u = material.wrap_v = TextureWrap::kClamp;
  return material;
}

/** Collects the triangles of one material. A corner of the same place, normal and texture
 *  coordinates is one vertex. */
class MeshBuilder {
public:
  /** @return false if the file has no such vertex, normal or texture coordinates */
  bool add_corner (const tinyobj::attrib_t &file, const tinyobj::index_t &index)
  {
    const auto [at, is_new] =
        known_.try_emplace ({index.vertex_index, index.normal_index, index.texcoord_index},
            std::uint32_t (mesh_.vertices.size ()));
    corners_.push_back (at->second);
    if (!is_new)
      return true;
    const auto has = [] (const std::vector<float> &values, int i, std::size_t n) {
      return i >= 0 && (std::size_t (i) + 1) * n <= values.size ();
    };
    if (!has (file.vertices, index.vertex_index, 3))
      return false;
    const float *p = file.vertices.data () + 3 * index.vertex_index;
    MeshVertex v{p[0], p[1], p[2], 0, 0, 0, 0, 0, 0};
    if (has (file.normals, index.normal_index, 3))
      std::copy_n (file.normals.data () + 3 * index.normal_index, 3, &v.nx);
    if (has (file.texcoords, index.texcoord_index, 2)) {
      v.u = file.texcoords[std::size_t (2 * index.texcoord_index)];
      v.v = 1 - file.texcoords[std::size_t (2 * index.texcoord_index + 1)]; /* from the bottom */
    }
    mesh_.vertices.push_back (v);
    if (has (file.colors, index.vertex_index, 3))
      mesh_.colours.push_back (byte_colour (file.colors.data () + 3 * index.vertex_index));
    return true;
  }

  Mesh finish ()
  {
    for (std::size_t i = 0; i + 2 < corners_.size (); i += 3)
      mesh_.triangles.push_back ({corners_[i], corners_[i + 1], corners_[i + 2]});
    if (mesh_.colours.size () != mesh_.vertices.size ())
      mesh_.colours.clear ();
    return std::move (mesh_);
  }

private:
  Mesh mesh_;
  std::vector<std::uint32_t> corners_;
  std::map<std::tuple<int, int, int>, std::uint32_t> known_;
};

} // namespace

Status
read_obj (const std::string &path, Model &model)
{
  tinyobj::attrib_t file;
  std::vector<tinyobj::shape_t> shapes;
  std::vector<tinyobj::material_t> materials;
  std::string warnings, error;
  const std::string folder = fs::absolute (fs::path (path)).parent_path ().string ();
  if (!tinyobj::LoadObj (&file, &shapes, &materials, &warnings, &error, path.c_str (),
          folder.c_str (), true, false))
    return {StatusCode::kBadData, path + ": cannot be read as a model (glTF or OBJ)"};
  for (const auto &material : materials)
    model.palette.push_back (material_of (material, path, model));
  std::map<int, MeshBuilder> builders; /* by material */
  std::size_t triangles = 0;
  for (const auto &shape : shapes) {
    triangles += shape.mesh.num_face_vertices.size ();
    if (file.vertices.size () / 3 > kMaxModelVertices || triangles > kMaxModelTriangles)
      return {
          StatusCode::kUnsupported, path + ": more than 4 million vertices or 8 million triangles"};
    for (std::size_t i = 0; i + 2 < shape.mesh.indices.size (); i += 3) {
      const std::size_t face = i / 3;
      const int material =
          face < shape.mesh.material_ids.size () ? shape.mesh.material_ids[face] : -1;
      MeshBuilder &to = builders[material < int (materials.size ()) ? material : -1];
      for (std::size_t k = 0; k < 3; k++)
        if (!to.add_corner (file, shape.mesh.indices[i + k]))
          return {StatusCode::kBadData, path + ": a face names a vertex that is missing"};
    }
  }
  for (auto &[material, builder] : builders) {
    model.meshes.push_back (builder.finish ());
    model.materials.push_back (std::max (material, -1));
  }
  return {};
}

} // namespace rangecast

#endif
