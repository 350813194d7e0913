/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "model.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>
#include <utility>

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
  return std::ranges::all_of (mesh.vertices, vertex_ok);
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
    if (!any_picture && materials.size () <= 1)
      beside_ = colour_map_beside (settings.path);
  }

  Status dress (int material, Mesh &mesh)
  {
    const ModelMaterial plain,
        &m = material < 0 ? plain : model_.palette[static_cast<std::size_t> (material)];
    mesh.double_sided = m.double_sided;
    if (!beside_.empty ()) {
      /* A colour map that lies beside a glTF file which does not name it was usually made for the
       * scan's first format, where v counts from the bottom; exporters copy v unchanged. */
      for (MeshVertex &vertex : mesh.vertices)
        vertex.v = 1 - vertex.v;
      return from_file (beside_, mesh);
    }
    if (m.picture >= 0)
      return from_material (m, mesh);
    if (any_colour_)
      mesh.texture = Mesh::plain_texture ({to_byte (255 * m.factor[0]), to_byte (255 * m.factor[1]),
          to_byte (255 * m.factor[2]), 255});
    return {};
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
      const Status s = !picture.bytes.empty ()
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
  std::set<std::array<std::uint32_t, 3>> seen;
  std::erase_if (mesh.triangles, [&seen] (auto key) {
    std::ranges::sort (key);
    return !seen.insert (key).second;
  });
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
      return {StatusCode::kBadData, settings.path + ": a position is not below 1e9, or a texture "
                                                    "coordinate not below 1e4"};
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
    return {StatusCode::kNotFound, path + ": no such model file (glTF)"};
  Figure loaded;
  try {
    Model model;
    Status status = read_gltf (path, model);
    if (status.ok ())
      status = make_figure (settings, model, loaded);
    if (!status.ok ())
      return status;
  } catch (const std::exception &) { /* of the readers, and of allocations */
    return {StatusCode::kBadData, path + ": cannot be read as a model (glTF)"};
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
      settings.path + ": built without models (option avatar-models); unset location"};
}

} // namespace rangecast

#endif
