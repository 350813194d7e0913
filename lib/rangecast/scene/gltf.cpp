/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* After the Khronos Group's glTF 2.0 specification (ISO/IEC 12113:2022); section numbers are its.
 */
#include "gltf.hpp"

#ifdef RANGECAST_HAVE_ASSIMP

#include <algorithm>
#include <cmath>
#include <map>

#include "gltf_document.hpp"
#include "pattern.hpp"

namespace rangecast {
namespace {

/** A 3 x 4 matrix: rotation and scale, then translation in the last column. */
struct Affine {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};

  [[nodiscard]] double determinant () const
  {
    double sum = 0;
    for (int i = 0; i < 3; i++)
      sum += m[0][i] * cofactor (0, i);
    return sum;
  }
  [[nodiscard]] double cofactor (int row, int column) const
  {
    const int r = (row + 1) % 3, s = (row + 2) % 3, c = (column + 1) % 3, d = (column + 2) % 3;
    return m[r][c] * m[s][d] - m[r][d] * m[s][c];
  }
};

Affine
operator* (const Affine &a, const Affine &b)
{
  Affine product;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 4; j++)
      product.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j] +
                        (j == 3 ? a.m[i][3] : 0);
  return product;
}

/** @param values  4 x 4, column by column */
template <typename Get>
Affine
affine_of (const Get &values)
{
  Affine result;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 4; j++)
      result.m[i][j] = values (4 * j + i);
  return result;
}

Affine
transform_of (const Json &node)
{
  if (const Json &matrix = node["matrix"]; matrix.size () == 16)
    return affine_of ([&] (int i) { return matrix[std::size_t (i)].number_or (0); });
  const auto at = [&] (const char *name, std::size_t i, double otherwise) {
    return node[name][i].number_or (otherwise);
  };
  const double x = at ("rotation", 0, 0), y = at ("rotation", 1, 0), z = at ("rotation", 2, 0),
               w = at ("rotation", 3, 1);
  const double rotation[3][3] = {
      {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
      {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
      {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  Affine result;
  for (std::size_t i = 0; i < 3; i++) {
    for (std::size_t j = 0; j < 3; j++)
      result.m[i][j] = rotation[i][j] * at ("scale", j, 1);
    result.m[i][3] = at ("translation", i, 0);
  }
  return result;
}

double
displayed (double linear) /* the sRGB transfer function */
{
  const double c = std::clamp (linear, 0.0, 1.0);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow (c, 1 / 2.4) - 0.055;
}

/** For each joint, world from the mesh's space as the joint would move it. */
using Skin = std::vector<Affine>;

/** Whether a primitive follows the skin's joints; else its node's transform places it. */
bool
follows (const Json &attributes, const Skin &skin)
{
  return !skin.empty () && !attributes["JOINTS_0"].is_null ();
}

/** Functions that return bool leave the reason in status_ when it is false. */
class Reader : GltfDocument {
public:
  Reader (std::string path, Model &model)
      : GltfDocument (std::move (path), model.storage), model_ (model)
  {
  }

  Status run ()
  {
    if (load_document () && read_nodes () && read_pictures () && read_materials ())
      read_scene ();
    return status_;
  }

private:
  bool read_nodes ();
  bool read_pictures ();
  bool read_texture (const Json &info, ModelMaterial &material);
  bool read_materials ();
  bool read_scene ();
  bool read_node_mesh (int node);
  bool read_skin (int index);
  bool read_primitive (const Json &primitive, const Affine &world, const Skin &skin);
  bool read_vertices (
      const Json &attributes, int coordinates, const Affine &world, const Skin &skin, Mesh &mesh);
  bool read_weights (const Json &attributes, const Affine &world, const Skin &skin,
      std::size_t vertices, std::vector<Affine> &pose);
  bool read_triangles (const Json &primitive, bool mirrored, Mesh &mesh);

  Model &model_;
  std::vector<Affine> world_; ///< of each node that a root reaches
  std::vector<bool> reached_;
  std::map<int, Skin> skins_; ///< that nodes have used
  std::size_t vertices_ = 0, triangles_ = 0;
};

/* World transforms; each node must have at most one parent (5.25), which also rules out cycles
 * among those that a root reaches. */
bool
Reader::read_nodes ()
{
  const Json &nodes = root_["nodes"];
  const std::size_t n = nodes.size ();
  std::vector<bool> child (n, false);
  for (const Json &node : nodes.items)
    for (const Json &index : node["children"].items) {
      const auto i = std::size_t (index.index ());
      if (i >= n || child[i])
        return fail (StatusCode::kBadData,
            "a node's child is missing or has two parents; expected a tree of nodes");
      child[i] = true;
    }
  world_.resize (n);
  reached_.assign (n, false);
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < n; i++)
    if (!child[i]) {
      open.push_back (i);
      world_[i] = transform_of (nodes[i]);
    }
  while (!open.empty ()) {
    const std::size_t parent = open.back ();
    open.pop_back ();
    reached_[parent] = true;
    for (const Json &index : nodes[parent]["children"].items) {
      const auto i = std::size_t (index.index ());
      world_[i] = world_[parent] * transform_of (nodes[i]);
      open.push_back (i);
    }
  }
  return true;
}

bool
Reader::read_pictures ()
{
  const Json &images = root_["images"];
  for (std::size_t i = 0; i < images.size (); i++) {
    ModelPicture picture;
    picture.name = path_ + ": picture " + std::to_string (i);
    picture.embedded = true;
    const Json &uri = images[i]["uri"];
    if (uri.is_null ()) {
      if (!view_bytes (images[i]["bufferView"].index (), picture.bytes))
        return false;
    } else if (uri.text.starts_with ("data:")) {
      if (!load_uri (uri.text, "a picture of a glTF model", picture.bytes))
        return false;
    } else {
      picture.embedded = false;
      picture.name = path_beside (uri.text);
    }
    model_.pictures.push_back (std::move (picture));
  }
  return true;
}

bool
Reader::read_texture (const Json &info, ModelMaterial &material)
{
  const Json &texture = root_["textures"][std::size_t (info["index"].index ())];
  const int source = texture["source"].index ();
  if (source < 0 && !texture["extensions"].names.empty ())
    return fail_extension (texture["extensions"].names[0]);
  if (source < 0 || std::size_t (source) >= model_.pictures.size ())
    return fail (StatusCode::kBadData, "a material's texture has no picture");
  material.picture = source;
  const Json &change = info["extensions"]["KHR_texture_transform"];
  material.coordinates = std::max (
      0, change["texCoord"].is_null () ? info["texCoord"].index () : change["texCoord"].index ());
  const double angle = change["rotation"].number_or (0),
               x = change["scale"][std::size_t{0}].number_or (1),
               y = change["scale"][1].number_or (1), c = std::cos (angle), s = std::sin (angle);
  material.transform = {c * x, s * y, change["offset"][std::size_t{0}].number_or (0), -s * x, c * y,
      change["offset"][1].number_or (0)};
  const auto wrap = [&] (const char *axis) {
    const int mode = root_["samplers"][std::size_t (texture["sampler"].index ())][axis].index ();
    return mode == 33071   ? TextureWrap::kClamp
           : mode == 33648 ? TextureWrap::kMirror
                           : TextureWrap::kRepeat;
  };
  material.wrap_u = wrap ("wrapS");
  material.wrap_v = wrap ("wrapT");
  return true;
}

bool
Reader::read_materials ()
{
  for (const Json &from : root_["materials"].items) {
    const Json &extensions = from["extensions"];
    const Json &old = extensions["KHR_materials_pbrSpecularGlossiness"];
    const bool use_old =
        from["pbrMetallicRoughness"]["baseColorTexture"].is_null () && !old.is_null ();
    const Json &base = use_old ? old : from["pbrMetallicRoughness"];
    const Json &texture = base[use_old ? "diffuseTexture" : "baseColorTexture"];
    const Json &factor = base[use_old ? "diffuseFactor" : "baseColorFactor"];
    ModelMaterial material;
    if (!texture.is_null () && !read_texture (texture, material))
      return false;
    for (std::size_t i = 0; i < 4; i++) {
      const double value = std::clamp (factor[i].number_or (1), 0.0, 1.0);
      material.factor[i] = i < 3 ? displayed (value) : value;
    }
    material.has_colour = material.picture >= 0 || !factor.is_null ();
    const std::string &mode = from["alphaMode"].text;
    material.masked = mode == "MASK" || mode == "BLEND";
    if (mode == "MASK")
      material.alpha_cutoff = std::clamp (from["alphaCutoff"].number_or (0.5), 0.0, 1.0);
    material.double_sided = from["doubleSided"].number != 0;
    material.visible =
        extensions["KHR_materials_transmission"]["transmissionFactor"].number_or (0) <= 0.5;
    model_.palette.push_back (material);
  }
  return true;
}

/* Draws the nodes of the scene that the file names, else of the first, else all. */
bool
Reader::read_scene ()
{
  const std::size_t n = root_["nodes"].size ();
  const Json &scene = root_["scenes"][std::size_t (std::max (0, root_["scene"].index ()))];
  std::vector<std::size_t> open;
  if (scene.is_null ())
    for (std::size_t i = 0; i < n; i++)
      open.push_back (i);
  std::vector<bool> drawn (n, false);
  for (const Json &index : scene["nodes"].items)
    open.push_back (std::size_t (index.index ()));
  while (!open.empty ()) {
    const std::size_t i = open.back ();
    open.pop_back ();
    if (i >= n || !reached_[i])
      return fail (StatusCode::kBadData, "a scene names a node that is missing or has no root");
    if (drawn[i])
      continue;
    drawn[i] = true;
    for (const Json &index : root_["nodes"][i]["children"].items)
      open.push_back (std::size_t (index.index ()));
  }
  for (std::size_t i = 0; i < n; i++)
    if (drawn[i] && !read_node_mesh (int (i)))
      return false;
  return true;
}

bool
Reader::read_node_mesh (int node)
{
  const Json &from = root_["nodes"][std::size_t (node)];
  const int index = from["mesh"].index ();
  if (index < 0)
    return true;
  const int skin = from["skin"].index ();
  if (skin >= 0 && !skins_.contains (skin) && !read_skin (skin))
    return false;
  for (const Json &primitive : root_["meshes"][std::size_t (index)]["primitives"].items)
    if (!read_primitive (primitive, world_[std::size_t (node)], skins_[skin]))
      return false;
  return true;
}

bool
Reader::read_skin (int index)
{
  Skin &skin = skins_[index];
  const Json &from = root_["skins"][std::size_t (index)];
  const Json &joints = from["joints"];
  Values inverse; /* absent: identities (5.28.1) */
  if (!from["inverseBindMatrices"].is_null ()) {
    if (!read (from["inverseBindMatrices"].index (), inverse))
      return false;
    if (inverse.components != 16 || inverse.count < joints.size ())
      return fail (StatusCode::kBadData, "a skin has fewer matrices than joints");
  }
  for (std::size_t i = 0; i < joints.size (); i++) {
    const auto node = std::size_t (joints[i].index ());
    if (node >= world_.size ())
      return fail (StatusCode::kBadData, "a skin names a node that is missing");
    const Affine bind = inverse.count == 0 ? Affine{} : affine_of ([&] (int k) {
      return double (inverse.numbers[16 * i + std::size_t (k)]);
    });
    skin.push_back (world_[node] * bind);
  }
  return true;
}

bool
Reader::read_primitive (const Json &primitive, const Affine &world, const Skin &skin)
{
  const int mode = primitive["mode"].is_null () ? 4 : primitive["mode"].index ();
  if (mode < 4 || mode > 6) /* points and lines have no surface */
    return true;
  const Json &position =
      root_["accessors"][std::size_t (primitive["attributes"]["POSITION"].index ())];
  for (const std::string &name : primitive["extensions"].names)
    if (position["bufferView"].is_null () && name.find ("compression") != std::string::npos)
      return fail_extension (name);
  const int material = primitive["material"].index ();
  if (material >= int (model_.palette.size ()))
    return fail (StatusCode::kBadData, "a mesh names a material that is missing");
  if (position["count"].size_or (0) > kMaxModelVertices)
    return fail (StatusCode::kUnsupported, "more than 4 million vertices");
  const int coordinates = material < 0 ? 0 : model_.palette[std::size_t (material)].coordinates;
  const bool mirrored = !follows (primitive["attributes"], skin) && world.determinant () < 0;
  Mesh mesh;
  if (!read_vertices (primitive["attributes"], coordinates, world, skin, mesh) ||
      !read_triangles (primitive, mirrored, mesh))
    return false;
  drop_unused_vertices (mesh);
  vertices_ += mesh.vertices.size ();
  triangles_ += mesh.triangles.size ();
  if (vertices_ > kMaxModelVertices || triangles_ > kMaxModelTriangles)
    return fail (StatusCode::kUnsupported, "more than 4 million vertices or 8 million triangles");
  model_.meshes.push_back (std::move (mesh));
  model_.materials.push_back (material);
  return true;
}

/* One transform a vertex if there is a skin: its joints' mean. */
bool
Reader::read_weights (const Json &attributes, const Affine &world, const Skin &skin,
    std::size_t vertices, std::vector<Affine> &pose)
{
  if (!follows (attributes, skin))
    return true;
  Affine none;
  for (auto &row : none.m)
    std::fill (std::begin (row), std::end (row), 0.0);
  pose.assign (vertices, none);
  std::vector<double> sums (vertices);
  for (const char *set : {"0", "1"}) {
    const std::string joints_name = std::string ("JOINTS_") + set,
                      weights_name = std::string ("WEIGHTS_") + set;
    if (attributes[joints_name].is_null () || attributes[weights_name].is_null ())
      continue;
    Values joints, weights;
    if (!read (attributes[joints_name].index (), joints) ||
        !read (attributes[weights_name].index (), weights))
      return false;
    if (joints.count != vertices || weights.count != vertices || joints.components != 4 ||
        weights.components != 4)
      return fail (StatusCode::kBadData, "joints or weights do not fit the vertices");
    for (std::size_t i = 0; i < 4 * vertices; i++) {
      const double weight = weights.numbers[i];
      if (!(weight > 0 && std::isfinite (weight)))
        continue;
      if (!(joints.numbers[i] >= 0 && joints.numbers[i] < float (skin.size ())))
        return fail (StatusCode::kBadData, "a vertex follows a joint that is missing");
      const Affine &joint = skin[std::size_t (joints.numbers[i])];
      for (int k = 0; k < 12; k++)
        pose[i / 4].m[k / 4][k % 4] += weight * joint.m[k / 4][k % 4];
      sums[i / 4] += weight;
    }
  }
  for (std::size_t i = 0; i < vertices; i++) {
    if (!(sums[i] > 0)) {
      pose[i] = world;
      continue;
    }
    for (auto &row : pose[i].m)
      for (double &value : row)
        value /= sums[i];
  }
  return true;
}

bool
Reader::read_vertices (
    const Json &attributes, int coordinates, const Affine &world, const Skin &skin, Mesh &mesh)
{
  Values positions, normals, places, colours;
  const auto optional = [&] (const std::string &name, Values &values) {
    if (attributes[name].is_null ())
      return true;
    if (!read (attributes[name].index (), values))
      return false;
    if (values.count != positions.count || values.components < 2)
      return fail (StatusCode::kBadData, name + " does not fit the vertices");
    return true;
  };
  if (!read (attributes["POSITION"].index (), positions))
    return false;
  if (positions.components != 3)
    return fail (StatusCode::kBadData, "POSITION is not of type VEC3");
  std::vector<Affine> pose;
  if (!optional ("NORMAL", normals) || !optional ("COLOR_0", colours) ||
      !optional ("TEXCOORD_" + std::to_string (coordinates), places) ||
      !read_weights (attributes, world, skin, positions.count, pose))
    return false;
  for (std::size_t i = 0; i < positions.count; i++) {
    const Affine &to = pose.empty () ? world : pose[i];
    const float *p = positions.numbers.data () + 3 * i;
    MeshVertex vertex{};
    for (int k = 0; k < 3; k++)
      (&vertex.x)[k] =
          float (to.m[k][0] * p[0] + to.m[k][1] * p[1] + to.m[k][2] * p[2] + to.m[k][3]);
    if (normals.components == 3) {
      const float *n = normals.numbers.data () + 3 * i;
      const double sign = to.determinant () < 0 ? -1 : 1;
      double turned[3], length = 0;
      for (int k = 0; k < 3; k++) {
        turned[k] = sign * (to.cofactor (k, 0) * n[0] + to.cofactor (k, 1) * n[1] +
                               to.cofactor (k, 2) * n[2]);
        length += turned[k] * turned[k];
      }
      for (int k = 0; k < 3 && length > 0 && std::isfinite (length); k++)
        (&vertex.nx)[k] = float (turned[k] / std::sqrt (length));
    }
    if (places.components == 2) {
      vertex.u = places.numbers[2 * i];
      vertex.v = places.numbers[2 * i + 1];
    }
    mesh.vertices.push_back (vertex);
    if (colours.components >= 3) {
      const float *c = colours.numbers.data () + std::size_t (colours.components) * i;
      const auto byte = [] (float value) {
        return to_byte (255 * displayed (std::isfinite (value) ? value : 1));
      };
      mesh.colours.push_back ({byte (c[0]), byte (c[1]), byte (c[2]), 255});
    }
  }
  return true;
}

bool
Reader::read_triangles (const Json &primitive, bool mirrored, Mesh &mesh)
{
  Values indices;
  indices.components = 1;
  if (primitive["indices"].is_null ()) {
    indices.count = mesh.vertices.size ();
    for (std::size_t i = 0; i < indices.count; i++)
      indices.numbers.push_back (float (i));
  } else if (!read (primitive["indices"].index (), indices)) {
    return false;
  }
  if (indices.components != 1 || !std::ranges::all_of (indices.numbers, [&] (float i) {
        return i >= 0 && i < float (mesh.vertices.size ());
      }))
    return fail (StatusCode::kBadData, "an index names a vertex that is missing");
  const int mode = primitive["mode"].is_null () ? 4 : primitive["mode"].index ();
  const auto add = [&] (std::size_t a, std::size_t b, std::size_t c) {
    const auto at = [&] (std::size_t i) { return std::uint32_t (indices.numbers[i]); };
    if (mirrored)
      std::swap (b, c);
    mesh.triangles.push_back ({at (a), at (b), at (c)});
  };
  for (std::size_t i = 0; i + 2 < indices.count; i += mode == 4 ? 3 : 1)
    if (mode == 6)
      add (0, i + 1, i + 2);
    else if (mode == 5 && i % 2)
      add (i, i + 2, i + 1);
    else
      add (i, i + 1, i + 2);
  return true;
}

} // namespace

Status
read_gltf (const std::string &path, Model &model)
{
  return Reader (path, model).run ();
}

} // namespace rangecast

#endif
