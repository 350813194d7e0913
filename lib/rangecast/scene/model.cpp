/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "model.hpp"

#ifdef RANGECAST_HAVE_ASSIMP

#include <algorithm>
#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "gltf.hpp"
#include "pattern.hpp"
#include "texture.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

/* Positions and texture coordinates that the rasteriser's arithmetic can hold: far more than any
 * scan, in any unit, needs. */
constexpr float kMaxPosition = 1e9f, kMaxTextureCoordinate = 1e4f;

bool
is_within (float value, float limit)
{
  return std::abs (value) <= limit; /* false for NaN */
}

bool
is_drawable (const Mesh &mesh)
{
  const auto vertex_ok = [] (const MeshVertex &v) {
    return is_within (v.x, kMaxPosition) && is_within (v.y, kMaxPosition) &&
           is_within (v.z, kMaxPosition) && is_within (v.u, kMaxTextureCoordinate) &&
           is_within (v.v, kMaxTextureCoordinate);
  };
  const auto triangle_ok = [&] (const auto &triangle) {
    return std::ranges::all_of (
        triangle, [&] (std::uint32_t index) { return index < mesh.vertices.size (); });
  };
  return std::ranges::all_of (mesh.vertices, vertex_ok) &&
         std::ranges::all_of (mesh.triangles, triangle_ok);
}

/* ---- what assimp reads ---- */

Rgbx
byte_colour (const aiColor4D &c)
{
  const auto byte = [] (float value) { return to_byte (255 * std::clamp (value, 0.f, 1.f)); };
  return {byte (c.r), byte (c.g), byte (c.b), 255};
}

Mesh
mesh_of (const aiMesh &from)
{
  Mesh mesh;
  for (unsigned i = 0; i < from.mNumVertices; i++) {
    const aiVector3D &p = from.mVertices[i];
    MeshVertex vertex{p.x, p.y, p.z, 0, 0, 0, 0, 0, 0};
    if (from.HasNormals ()) {
      const aiVector3D &n = from.mNormals[i];
      vertex.nx = n.x, vertex.ny = n.y, vertex.nz = n.z;
    }
    if (from.HasTextureCoords (0)) {
      vertex.u = from.mTextureCoords[0][i].x;
      vertex.v = 1 - from.mTextureCoords[0][i].y; /* assimp counts from the picture's bottom */
    }
    mesh.vertices.push_back (vertex);
    if (from.HasVertexColors (0))
      mesh.colours.push_back (byte_colour (from.mColors[0][i]));
  }
  for (unsigned i = 0; i < from.mNumFaces; i++) {
    const aiFace &face = from.mFaces[i];
    if (face.mNumIndices == 3) /* points and lines have no surface */
      mesh.triangles.push_back ({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
  }
  return mesh;
}

/* A picture inside the model's own file: compressed, or plain BGRA, for which there is no name. */
void
add_picture (const aiScene &scene, const std::string &model, const char *name, Model &to)
{
  ModelPicture picture;
  if (const aiTexture *embedded = scene.GetEmbeddedTexture (name)) {
    picture.name = model + " (its texture)";
    picture.embedded = true;
    const auto *bytes = reinterpret_cast<const std::uint8_t *> (embedded->pcData);
    if (embedded->mHeight == 0)
      picture.bytes = to.storage.emplace_back (bytes, bytes + embedded->mWidth);
  } else {
    std::string text = name;
    std::ranges::replace (text, '\\', '/'); /* as programs on Windows write it */
    const fs::path folder = fs::path (model).parent_path (), path = text;
    /* Some exporters write where the picture was on their own machine. */
    std::error_code error;
    const bool there = fs::exists (folder / path, error);
    const bool beside = fs::exists (folder / path.filename (), error);
    picture.name = (folder / (!there && beside ? path.filename () : path)).string ();
  }
  to.pictures.push_back (std::move (picture));
}

ModelMaterial
material_of (const aiScene &scene, const std::string &model, const aiMaterial &from, Model &to)
{
  ModelMaterial material;
  material.double_sided = true; /* OBJ has no flag for it, and leaves sheets open */
  aiString name;
  aiTextureMapMode modes[2] = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
  for (aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE})
    if (material.picture < 0 &&
        from.GetTexture (type, 0, &name, nullptr, nullptr, nullptr, nullptr, modes) == AI_SUCCESS) {
      material.picture = int (to.pictures.size ());
      add_picture (scene, model, name.C_Str (), to);
    }
  const auto wrap = [] (aiTextureMapMode mode) {
    return mode == aiTextureMapMode_Clamp    ? TextureWrap::kClamp
           : mode == aiTextureMapMode_Mirror ? TextureWrap::kMirror
                                             : TextureWrap::kRepeat;
  };
  material.wrap_u = wrap (modes[0]);
  material.wrap_v = wrap (modes[1]);
  /* A picture that is both colour and opacity has its own alpha. */
  aiString opacity;
  material.masked = from.GetTexture (aiTextureType_OPACITY, 0, &opacity) == AI_SUCCESS &&
                    material.picture >= 0 && opacity == name;
  aiColor4D colour;
  const bool unnamed = from.GetName () == aiString (AI_DEFAULT_MATERIAL_NAME);
  if (material.picture < 0 && !unnamed && /* exporters leave any colour beside a picture */
      from.Get (AI_MATKEY_COLOR_DIFFUSE, colour) == AI_SUCCESS) {
    material.factor = {colour.r, colour.g, colour.b, 1};
    material.has_colour = true;
  }
  material.has_colour |= material.picture >= 0;
  float visible = 1;
  from.Get (AI_MATKEY_OPACITY, visible);
  material.visible = visible >= 0.5f;
  return material;
}

Status
read_with_assimp (const std::string &path, Model &model)
{
  Assimp::Importer importer;
  const aiScene *scene =
      importer.ReadFile (path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                   aiProcess_PreTransformVertices | aiProcess_SortByPType);
  if (!scene)
    return {StatusCode::kBadData, path + ": cannot be read as a model; expected glTF or OBJ"};
  std::size_t vertices = 0, triangles = 0;
  for (unsigned i = 0; i < scene->mNumMeshes; i++) {
    const aiMesh &mesh = *scene->mMeshes[i];
    vertices += mesh.mNumVertices;
    triangles += mesh.mNumFaces;
    if (vertices > kMaxModelVertices || triangles > kMaxModelTriangles)
      return {
          StatusCode::kUnsupported, path + ": more than 4 million vertices or 8 million triangles"};
    model.meshes.push_back (mesh_of (mesh));
    model.materials.push_back (
        mesh.mMaterialIndex < scene->mNumMaterials ? int (mesh.mMaterialIndex) : -1);
  }
  for (unsigned i = 0; i < scene->mNumMaterials; i++)
    model.palette.push_back (material_of (*scene, path, *scene->mMaterials[i], model));
  return {};
}

/* ---- textures ---- */

std::string
lower_case (std::string text)
{
  std::ranges::transform (text, text.begin (), [] (unsigned char c) { return std::tolower (c); });
  return text;
}

/* A picture in the model's folder whose name says that it is a colour map, or nothing. */
std::string
colour_map_beside (const std::string &model)
{
  std::error_code error;
  const fs::path folder = fs::path (model).parent_path ();
  std::string found;
  for (const auto &entry : fs::directory_iterator (folder.empty () ? "." : folder, error)) {
    const std::string stem = lower_case (entry.path ().stem ().string ());
    const std::string type = lower_case (entry.path ().extension ().string ());
    const bool picture = type == ".jpg" || type == ".jpeg" || type == ".png";
    bool named = false;
    for (const char *word : {"albedo", "diffuse", "basecolor", "base_color", "colour", "color"})
      named |= stem.find (word) != std::string::npos;
    for (const char *word : {"_col", "-col", " col"}) /* Map-COL.jpg */
      named |= stem.ends_with (word);
    if (picture && named && (found.empty () || entry.path ().string () < found))
      found = entry.path ().string ();
  }
  return found;
}

void
turn_texture (Mesh &mesh)
{
  for (MeshVertex &vertex : mesh.vertices)
    vertex.v = 1 - vertex.v;
}

/** Gives meshes their textures; a texture that several materials share is decoded once. */
class Texturer {
public:
  Texturer (const ModelSettings &settings, const Model &model)
      : settings_ (settings), model_ (model)
  {
    const auto used = [&model] (auto test) { return std::ranges::any_of (model.palette, test); };
    const bool any_picture = used ([] (const ModelMaterial &m) { return m.picture >= 0; });
    any_colour_ = used ([] (const ModelMaterial &m) { return m.has_colour; }) ||
                  std::ranges::any_of (
                      model.meshes, [] (const Mesh &mesh) { return !mesh.colours.empty (); });
    /* Many textures share the memory of sixteen of 2048 x 2048. */
    const std::size_t n = model.pictures.size ();
    max_side_ = n <= 16 ? 2048 : n <= 64 ? 1024 : n <= 256 ? 512 : 256;
    const std::set<int> materials (model.materials.begin (), model.materials.end ());
    if (settings.texture.empty () && !any_picture && materials.size () <= 1)
      beside_ = colour_map_beside (settings.path);
  }

  Status dress (int material, Mesh &mesh)
  {
    const ModelMaterial plain,
        &m = material < 0 ? plain : model_.palette[static_cast<std::size_t> (material)];
    mesh.double_sided = m.double_sided;
    Status status;
    if (!settings_.texture.empty ()) {
      status = from_file (settings_.texture, mesh);
    } else if (!beside_.empty ()) {
      /* A colour map that lies beside a glTF file which does not name it was usually made for the
       * scan's first format, where v counts from the bottom; exporters copy v unchanged. */
      if (is_gltf (settings_.path))
        turn_texture (mesh);
      status = from_file (beside_, mesh);
    } else if (m.picture >= 0) {
      status = from_material (m, mesh);
    } else if (any_colour_) {
      mesh.texture = Mesh::plain_texture ({to_byte (255 * m.factor[0]), to_byte (255 * m.factor[1]),
          to_byte (255 * m.factor[2]), 255});
    }
    if (settings_.texture_flip)
      turn_texture (mesh);
    return status;
  }

private:
  Status from_file (const std::string &path, Mesh &mesh)
  {
    mesh.colours.clear ();
    if (!file_)
      if (Status s = read_texture (path, {4 * max_side_, {1, 1, 1, 1}, 0}, file_); !s.ok ())
        return s;
    mesh.texture = file_;
    return {};
  }

  Status from_material (const ModelMaterial &m, Mesh &mesh)
  {
    const ModelPicture &picture = model_.pictures[static_cast<std::size_t> (m.picture)];
    TextureSettings settings;
    settings.max_side = max_side_;
    std::ranges::copy (m.factor, settings.factor);
    if (m.masked)
      settings.alpha_cutoff =
          static_cast<std::uint8_t> (std::clamp (std::lround (255 * m.alpha_cutoff), 0l, 255l));
    auto &texture = made_[{m.picture, m.factor, settings.alpha_cutoff}];
    if (!texture) {
      const Status s = picture.embedded
                           ? decode_texture (picture.bytes, picture.name, settings, texture)
                           : read_texture (picture.name, settings, texture);
      if (!s.ok ())
        return s;
    }
    mesh.texture = texture;
    mesh.alpha_cutoff = settings.alpha_cutoff;
    place_texture (m, mesh);
    return {};
  }

  /* The material's transform, and wrap where coordinates leave the picture. */
  static void place_texture (const ModelMaterial &m, Mesh &mesh)
  {
    float low[2] = {1e30f, 1e30f}, high[2] = {-1e30f, -1e30f};
    for (MeshVertex &vertex : mesh.vertices) {
      const double u = vertex.u, v = vertex.v;
      const auto &t = m.transform;
      vertex.u = static_cast<float> (t[0] * u + t[1] * v + t[2]);
      vertex.v = static_cast<float> (t[3] * u + t[4] * v + t[5]);
      for (int i = 0; i < 2; i++) {
        low[i] = std::min (low[i], (&vertex.u)[i]);
        high[i] = std::max (high[i], (&vertex.u)[i]);
      }
    }
    const auto leaves = [&] (int i) { return low[i] < -1e-4f || high[i] > 1.0001f; };
    mesh.wrap_u = leaves (0) ? m.wrap_u : TextureWrap::kClamp;
    mesh.wrap_v = leaves (1) ? m.wrap_v : TextureWrap::kClamp;
    /* Whole periods change nothing, and small numbers keep their digits. */
    const float period_u = 2 * std::floor (low[0] / 2), period_v = 2 * std::floor (low[1] / 2);
    for (MeshVertex &vertex : mesh.vertices) {
      vertex.u -= mesh.wrap_u == TextureWrap::kClamp ? 0 : period_u;
      vertex.v -= mesh.wrap_v == TextureWrap::kClamp ? 0 : period_v;
    }
  }

  const ModelSettings &settings_;
  const Model &model_;
  bool any_colour_ = false;
  int max_side_ = 0;
  std::string beside_;
  std::shared_ptr<const MipMap> file_;
  std::map<std::tuple<int, std::array<double, 4>, int>, std::shared_ptr<const MipMap>> made_;
};

/* ---- geometry ---- */

/* Exporters write a sheet's both sides as two triangles where a format has no flag for it; of a
 * double-sided mesh one is enough, and opposite normals would cancel. */
void
drop_second_sides (Mesh &mesh)
{
  std::vector<std::pair<std::array<std::uint32_t, 3>, std::size_t>> sorted;
  for (std::size_t i = 0; i < mesh.triangles.size (); i++) {
    auto key = mesh.triangles[i];
    std::ranges::sort (key);
    sorted.emplace_back (key, i);
  }
  std::ranges::sort (sorted);
  std::vector<std::array<std::uint32_t, 3>> kept;
  std::vector<bool> second (mesh.triangles.size (), false);
  for (std::size_t i = 1; i < sorted.size (); i++)
    second[sorted[i].second] = sorted[i].first == sorted[i - 1].first;
  for (std::size_t i = 0; i < mesh.triangles.size (); i++)
    if (!second[i])
      kept.push_back (mesh.triangles[i]);
  mesh.triangles = std::move (kept);
}

bool
has_normals (const Mesh &mesh)
{
  return std::ranges::all_of (mesh.vertices, [] (const MeshVertex &v) {
    const float length = v.nx * v.nx + v.ny * v.ny + v.nz * v.nz;
    return length > 0.5f && length < 2;
  });
}

Status
make_figure (const ModelSettings &settings, Model &model, Figure &figure)
{
  Texturer texturer (settings, model);
  for (std::size_t i = 0; i < model.meshes.size (); i++) {
    const int material = model.materials[i];
    if (material >= 0) {
      const ModelMaterial &m = model.palette[static_cast<std::size_t> (material)];
      const bool clear = m.masked && m.factor[3] < m.alpha_cutoff;
      if (!m.visible || clear)
        continue;
    }
    Mesh mesh = std::move (model.meshes[i]);
    if (mesh.triangles.empty ())
      continue;
    if (Status s = texturer.dress (material, mesh); !s.ok ())
      return s;
    if (!is_drawable (mesh))
      return {StatusCode::kBadData, settings.path + ": a position, texture coordinate or index is "
                                                    "out of range; expected finite positions below "
                                                    "1e9 and texture coordinates below 1e4"};
    if (mesh.double_sided)
      drop_second_sides (mesh);
    if (!has_normals (mesh))
      compute_normals (mesh);
    figure.push_back (std::move (mesh));
  }
  if (figure.empty ())
    return {StatusCode::kBadData, settings.path + ": a model without triangles"};
  return {};
}

} // namespace

Status
load_model (const ModelSettings &settings, Figure &figure)
{
  const std::string &path = settings.path;
  std::error_code error;
  if (!fs::is_regular_file (path, error))
    return {StatusCode::kNotFound, path + ": no such file; expected a model (glTF or OBJ)"};
  Figure loaded;
  try {
    Model model;
    Status status = is_gltf (path) ? read_gltf (path, model) : read_with_assimp (path, model);
    if (status.ok ())
      status = make_figure (settings, model, loaded);
    if (!status.ok ())
      return status;
  } catch (const std::exception &) { /* assimp, and allocations */
    return {StatusCode::kBadData, path + ": cannot be read as a model; expected glTF or OBJ"};
  }
  if (!fit_figure (loaded, settings.top_m))
    return {StatusCode::kBadValue,
        "model-top: " + path + " has no triangle that lies wholly in that part of it"};
  figure = std::move (loaded);
  return {};
}

} // namespace rangecast

#else

namespace rangecast {

Status
load_model (const ModelSettings &settings, Figure &)
{
  return {StatusCode::kUnsupported,
      settings.path + ": this build reads no models (built without assimp); expected no location"};
}

} // namespace rangecast

#endif
