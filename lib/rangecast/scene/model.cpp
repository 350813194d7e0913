/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "model.hpp"

#ifdef RANGECAST_HAVE_ASSIMP

#include <algorithm>
#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "../geometry/range_image.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

/* More than any scan that a software rasteriser could draw live. */
constexpr std::size_t kMaxVertices = 4'000'000;

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

void
add_mesh (const aiMesh &from, Mesh &mesh)
{
  const auto first = static_cast<std::uint32_t> (mesh.vertices.size ());
  for (unsigned i = 0; i < from.mNumVertices; i++) {
    const aiVector3D &p = from.mVertices[i];
    MeshVertex vertex{p.x, p.y, p.z, 0, 0, 0, 0, 0, 0};
    if (from.HasTextureCoords (0)) {
      vertex.u = from.mTextureCoords[0][i].x;
      /* assimp counts from the picture's bottom, whatever the file does: it turns glTF's v. */
      vertex.v = 1 - from.mTextureCoords[0][i].y;
    }
    mesh.vertices.push_back (vertex);
  }
  for (unsigned i = 0; i < from.mNumFaces; i++) {
    const aiFace &face = from.mFaces[i];
    if (face.mNumIndices == 3) /* points and lines have no surface */
      mesh.triangles.push_back (
          {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
  }
}

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

Status
take_picture (const cv::Mat &bgr, const std::string &name, Mesh &mesh)
{
  if (bgr.empty () || bgr.type () != CV_8UC3 || bgr.cols > kMaxImageSide ||
      bgr.rows > kMaxImageSide)
    return {StatusCode::kBadData, name + ": cannot be read as a picture; expected JPEG or PNG"};
  std::vector<Rgbx> pixels;
  pixels.reserve (bgr.total ());
  for (int y = 0; y < bgr.rows; y++)
    for (int x = 0; x < bgr.cols; x++) {
      const auto &p = bgr.at<cv::Vec3b> (y, x);
      pixels.push_back ({p[2], p[1], p[0], 0});
    }
  mesh.texture = MipMap (bgr.cols, bgr.rows, std::move (pixels));
  return {};
}

Status
take_picture_file (const std::string &path, Mesh &mesh)
{
  std::error_code error;
  if (!fs::is_regular_file (path, error))
    return {StatusCode::kNotFound, path + ": no such file; expected a texture (JPEG or PNG)"};
  return take_picture (cv::imread (path, cv::IMREAD_COLOR), path, mesh);
}

void
turn_texture (Mesh &mesh)
{
  for (MeshVertex &vertex : mesh.vertices)
    vertex.v = 1 - vertex.v;
}

/* A colour map that lies beside a glTF file which does not name it was as a rule drawn for the
 * scan's first format, where v counts from the bottom; exporters carry v over as it is. */
Status
take_picture_beside (const std::string &model, Mesh &mesh)
{
  const std::string picture = colour_map_beside (model);
  if (picture.empty ())
    return {};
  const std::string type = lower_case (fs::path (model).extension ().string ());
  if (type == ".glb" || type == ".gltf")
    turn_texture (mesh);
  return take_picture_file (picture, mesh);
}

/* A picture inside the model's own file: compressed, or plain BGRA. */
Status
take_embedded (const aiTexture &texture, const std::string &model, Mesh &mesh)
{
  if (texture.mHeight == 0) {
    const cv::Mat bytes (1, static_cast<int> (texture.mWidth), CV_8U, texture.pcData);
    return take_picture (cv::imdecode (bytes, cv::IMREAD_COLOR), model + " (its texture)", mesh);
  }
  cv::Mat bgr (static_cast<int> (texture.mHeight), static_cast<int> (texture.mWidth), CV_8UC3);
  for (int y = 0; y < bgr.rows; y++)
    for (int x = 0; x < bgr.cols; x++) {
      const aiTexel &t = texture.pcData[y * bgr.cols + x];
      bgr.at<cv::Vec3b> (y, x) = {t.b, t.g, t.r};
    }
  return take_picture (bgr, model + " (its texture)", mesh);
}

Status
take_texture (
    const aiScene &scene, const std::string &model, const std::string &texture, Mesh &mesh)
{
  if (!texture.empty ())
    return take_picture_file (texture, mesh);
  for (unsigned i = 0; i < scene.mNumMaterials; i++)
    for (aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      aiString name;
      if (scene.mMaterials[i]->GetTexture (type, 0, &name) != AI_SUCCESS)
        continue;
      if (const aiTexture *embedded = scene.GetEmbeddedTexture (name.C_Str ()))
        return take_embedded (*embedded, model, mesh);
      return take_picture_file ((fs::path (model).parent_path () / name.C_Str ()).string (), mesh);
    }
  return take_picture_beside (model, mesh);
}

} // namespace

Status
load_model (const std::string &path, const std::string &texture, bool flip, Mesh &mesh)
{
  std::error_code error;
  if (!fs::is_regular_file (path, error))
    return {StatusCode::kNotFound, path + ": no such file; expected a model (glTF or OBJ)"};
  Mesh loaded;
  try {
    Assimp::Importer importer;
    const aiScene *scene =
        importer.ReadFile (path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                     aiProcess_PreTransformVertices | aiProcess_SortByPType);
    if (!scene)
      return {StatusCode::kBadData, path + ": cannot be read as a model; expected glTF or OBJ"};
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
      if (loaded.vertices.size () + scene->mMeshes[i]->mNumVertices > kMaxVertices)
        return {StatusCode::kUnsupported, path + ": more than 4 million vertices"};
      add_mesh (*scene->mMeshes[i], loaded);
    }
    if (loaded.triangles.empty ())
      return {StatusCode::kBadData, path + ": a model without triangles"};
    if (!is_drawable (loaded))
      return {StatusCode::kBadData, path + ": a position, texture coordinate or index is out of "
                                           "range; expected finite positions below 1e9 and texture "
                                           "coordinates below 1e4"};
    if (Status s = take_texture (*scene, path, texture, loaded); !s.ok ())
      return s;
    if (flip)
      turn_texture (loaded);
  } catch (const std::exception &) { /* OpenCV's decoders and allocations */
    return {StatusCode::kBadData, path + ": cannot be read as a model; expected glTF or OBJ"};
  }
  fit_figure (loaded);
  compute_normals (loaded);
  mesh = std::move (loaded);
  return {};
}

} // namespace rangecast

#else

namespace rangecast {

Status
load_model (const std::string &path, const std::string &, bool, Mesh &)
{
  return {StatusCode::kUnsupported,
      path + ": this build reads no models (built without assimp); expected no location"};
}

} // namespace rangecast

#endif
