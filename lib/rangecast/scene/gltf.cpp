/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* After the Khronos Group's glTF 2.0 specification (ISO/IEC 12113:2022); section numbers are its.
 */
#include "model.hpp"

#ifdef RANGECAST_HAVE_MODELS

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <span>
#include <tiny_gltf.h>

#include "pattern.hpp"
#include "texture.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

constexpr std::size_t kMaxFile = std::size_t{1} << 30;
constexpr std::size_t kMaxCount = 3 * kMaxModelTriangles, kMaxElements = 256'000'000;
constexpr std::string_view kMagic = "glTF";

/* Extensions that a file may require and that change nothing we draw, or that we read. */
constexpr std::string_view kReadExtensions[] = {
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual", "KHR_xmp_json_ld"};

using Bytes = std::span<const std::uint8_t>;

/* ---- numbers ---- */

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
template <typename T>
Affine
affine_of (const T *values)
{
  Affine result;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 4; j++)
      result.m[i][j] = double (values[4 * j + i]);
  return result;
}

Affine
transform_of (const tinygltf::Node &node)
{
  if (node.matrix.size () == 16)
    return affine_of (node.matrix.data ());
  const auto at = [] (const std::vector<double> &values, std::size_t i, double otherwise) {
    return i < values.size () ? values[i] : otherwise;
  };
  const double x = at (node.rotation, 0, 0), y = at (node.rotation, 1, 0),
               z = at (node.rotation, 2, 0), w = at (node.rotation, 3, 1);
  const double rotation[3][3] = {
      {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
      {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
      {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  Affine result;
  for (std::size_t i = 0; i < 3; i++) {
    for (std::size_t j = 0; j < 3; j++)
      result.m[i][j] = rotation[i][j] * at (node.scale, j, 1);
    result.m[i][3] = at (node.translation, i, 0);
  }
  return result;
}

double
displayed (double linear) /* the sRGB transfer function */
{
  const double c = std::clamp (linear, 0.0, 1.0);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow (c, 1 / 2.4) - 0.055;
}

/* A number in an extension. */
double
number_in (const tinygltf::Value &object, const char *name, double otherwise, int index = -1)
{
  if (!object.Has (name))
    return otherwise;
  const tinygltf::Value &member = object.Get (name);
  const tinygltf::Value &value = index >= 0 && member.IsArray () ? member.Get (index) : member;
  return value.IsNumber () ? value.GetNumberAsDouble () : otherwise;
}

tinygltf::Value
extension (const tinygltf::ExtensionMap &extensions, const char *name)
{
  const auto found = extensions.find (name);
  return found == extensions.end () ? tinygltf::Value () : found->second;
}

template <typename T>
T
load (const std::uint8_t *from)
{
  T value;
  std::memcpy (&value, from, sizeof value);
  return value;
}

float
component (const std::uint8_t *from, int type, bool normalised)
{
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return normalised ? std::max (float (load<std::int8_t> (from)) / 127, -1.f)
                        : float (load<std::int8_t> (from));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return float (*from) / (normalised ? 255.f : 1.f);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return normalised ? std::max (float (load<std::int16_t> (from)) / 32767, -1.f)
                        : float (load<std::int16_t> (from));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return float (load<std::uint16_t> (from)) / (normalised ? 65535.f : 1.f);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return float (load<std::uint32_t> (from));
    default:
      return load<float> (from);
  }
}

/* ---- files ---- */

/* tinygltf copies extras by recursion and makes an object of each value: what nests too deep would
 * overflow the stack, and commas alone fill the memory. */
Status
check_json (std::string_view text)
{
  constexpr int kMaxDepth = 64, kMaxValues = 4'000'000;
  int depth = 0, values = 1;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size (); i++) {
    const char c = text[i];
    if (c == '"')
      quoted = !quoted;
    else if (quoted)
      i += c == '\\';
    else if (c == '[' || c == '{')
      depth++, values++;
    else if (c == ']' || c == '}')
      depth--;
    else if (c == ',')
      values++;
    if (depth > kMaxDepth || values > kMaxValues)
      return {StatusCode::kUnsupported, "more than 4 million JSON values, or 64 levels of them"};
  }
  return {};
}

/* tinygltf would open directories and devices, too. */
bool
read_beside (std::vector<unsigned char> *bytes, std::string *error, const std::string &path, void *)
{
  const Status status = read_file (path, kMaxFile, "a file that a glTF model names", *bytes);
  *error += status.message ();
  return status.ok () && !bytes->empty ();
}

/* Pictures stay compressed: the texture's reader checks their size. The data of one in a buffer
 * view is not read here, for nothing has checked where it lies. */
bool
keep_picture (tinygltf::Image *image, int, std::string *, std::string *, int, int,
    const unsigned char *bytes, int size, void *)
{
  if (image->bufferView < 0)
    image->image.assign (bytes, bytes + size);
  return true;
}

/** The elements of an accessor. */
struct Values {
  std::vector<float> numbers; ///< `components` for each element
  std::size_t count = 0;
  int components = 0;
};

/** Functions that return bool leave the reason in status_ when it is false. */
class Reader {
public:
  Reader (std::string path, Model &model) : path_ (std::move (path)), model_ (model) {}

  Status run ()
  {
    if (load_document () && read_nodes () && read_pictures () && read_materials ())
      read_scene ();
    return status_;
  }

private:
  using Primitive = tinygltf::Primitive;

  bool fail (StatusCode code, const std::string &what)
  {
    status_ = {code, path_ + ": " + what};
    return false;
  }
  bool fail_extension (const std::string &name)
  {
    return fail (StatusCode::kUnsupported,
        "needs the glTF extension " + name + ", which is not supported; export it without");
  }

  bool load_document ();
  bool view_bytes (int view, Bytes &bytes);
  bool read (int accessor, Values &values);
  bool read_nodes ();
  bool read_pictures ();
  bool read_texture (const tinygltf::TextureInfo &info, ModelMaterial &material);
  bool read_materials ();
  bool read_scene ();
  bool read_node_mesh (std::size_t node);
  bool read_skin (int index, Affine &world);
  bool read_primitive (const Primitive &primitive, const Affine &world);
  bool read_vertices (const Primitive &primitive, int coordinates, const Affine &world, Mesh &mesh);
  bool read_triangles (const Primitive &primitive, bool mirrored, Mesh &mesh);

  const std::string path_;
  Status status_;
  tinygltf::Model file_;
  Model &model_;
  std::size_t elements_ = 0;  ///< that accessors have given
  std::vector<Affine> world_; ///< of each node that a root reaches
  std::vector<bool> reached_;
  std::size_t vertices_ = 0, triangles_ = 0;
};

bool
Reader::load_document ()
{
  std::vector<std::uint8_t> bytes;
  if (status_ = read_file (path_, kMaxFile, "a model (glTF)", bytes); !status_.ok ())
    return false;
  const auto size = unsigned (bytes.size ());
  bytes.resize (bytes.size () + 8); /* tinygltf 2.7 ignores a chunk's header when it checks ends */
  const auto *text = reinterpret_cast<const char *> (bytes.data ());
  const bool binary = std::string_view (text, size).starts_with (kMagic);
  const std::size_t begin = binary ? 20 : 0, length = binary && size >= begin
                                                          ? load<std::uint32_t> (bytes.data () + 12)
                                                          : size;
  if (begin > size || length > size - begin)
    return fail (StatusCode::kTruncated, "ends before its JSON does");
  if (const Status checked = check_json ({text + begin, length}); !checked.ok ())
    return fail (checked.code (), checked.message ());

  tinygltf::TinyGLTF reader;
  reader.SetImageLoader (keep_picture, nullptr);
  reader.SetFsCallbacks ({tinygltf::FileExists, tinygltf::ExpandFilePath, read_beside,
      tinygltf::WriteWholeFile, nullptr});
  const std::string folder = fs::absolute (fs::path (path_)).parent_path ().string ();
  std::string error, warning;
  const bool loaded =
      binary ? reader.LoadBinaryFromMemory (&file_, &error, &warning, bytes.data (), size, folder)
             : reader.LoadASCIIFromString (&file_, &error, &warning, text, size, folder);
  if (!loaded) {
    std::ranges::replace (error, '\n', ' ');
    return fail (StatusCode::kBadData, "cannot be read as glTF 2.0: " + error.substr (0, 200));
  }
  for (const std::string &name : file_.extensionsRequired)
    if (!name.starts_with ("KHR_materials_") && !std::ranges::count (kReadExtensions, name))
      return fail_extension (name);
  return true;
}

bool
Reader::view_bytes (int index, Bytes &bytes)
{
  const std::string name = "buffer view " + std::to_string (index);
  if (index < 0 || std::size_t (index) >= file_.bufferViews.size ())
    return fail (StatusCode::kBadData, name + " is missing");
  const tinygltf::BufferView &view = file_.bufferViews[std::size_t (index)];
  if (view.buffer < 0 || std::size_t (view.buffer) >= file_.buffers.size ())
    return fail (StatusCode::kBadData, name + " has no buffer");
  const Bytes buffer = file_.buffers[std::size_t (view.buffer)].data;
  if (view.byteOffset > buffer.size () || view.byteLength > buffer.size () - view.byteOffset)
    return fail (StatusCode::kBadData, name + " reaches beyond its buffer");
  bytes = buffer.subspan (view.byteOffset, view.byteLength);
  return true;
}

bool
Reader::read (int index, Values &values)
{
  const std::string name = "accessor " + std::to_string (index);
  if (index < 0 || std::size_t (index) >= file_.accessors.size ())
    return fail (StatusCode::kBadData, name + " is missing");
  const tinygltf::Accessor &from = file_.accessors[std::size_t (index)];
  if (from.sparse.isSparse || from.bufferView < 0)
    return fail (StatusCode::kUnsupported,
        name + " has no plain data: export without compression and sparse accessors");
  Bytes bytes;
  if (!view_bytes (from.bufferView, bytes))
    return false;
  values.count = from.count;
  values.components = tinygltf::GetNumComponentsInType (std::uint32_t (from.type));
  if (elements_ += std::min (values.count, kMaxElements); elements_ > kMaxElements)
    return fail (StatusCode::kUnsupported, "accessors of more than 256 million elements");
  if (from.componentType == TINYGLTF_COMPONENT_TYPE_INT ||
      from.componentType == TINYGLTF_COMPONENT_TYPE_DOUBLE || values.components <= 0 ||
      values.count > kMaxCount)
    return fail (StatusCode::kBadData, name + " is of an unknown type or size");
  const auto size =
      std::size_t (tinygltf::GetComponentSizeInBytes (std::uint32_t (from.componentType)));
  const auto n = std::size_t (values.components);
  const std::size_t given = file_.bufferViews[std::size_t (from.bufferView)].byteStride,
                    stride = given ? given : n * size; /* at most 252: tinygltf refuses more */
  const bool fits = stride >= n * size && from.byteOffset <= bytes.size () &&
                    (values.count == 0 ||
                        (values.count - 1) * stride + n * size <= bytes.size () - from.byteOffset);
  if (!fits)
    return fail (StatusCode::kBadData, name + " reaches beyond its buffer view");
  values.numbers.resize (values.count * n);
  float *to = values.numbers.data ();
  for (std::size_t i = 0; i < values.count; i++)
    for (std::size_t c = 0; c < n; c++)
      *to++ = component (bytes.data () + from.byteOffset + i * stride + c * size,
          from.componentType, from.normalized);
  return true;
}

/* World transforms; each node must have at most one parent (5.25), which also rules out cycles
 * among those that a root reaches. */
bool
Reader::read_nodes ()
{
  const auto &nodes = file_.nodes;
  std::vector<bool> child (nodes.size (), false);
  for (const auto &node : nodes)
    for (const int i : node.children) {
      if (i < 0 || std::size_t (i) >= nodes.size () || child[std::size_t (i)])
        return fail (StatusCode::kBadData,
            "a node's child is missing or has two parents: nodes must be a tree");
      child[std::size_t (i)] = true;
    }
  world_.resize (nodes.size ());
  reached_.assign (nodes.size (), false);
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < nodes.size (); i++)
    if (!child[i]) {
      open.push_back (i);
      world_[i] = transform_of (nodes[i]);
    }
  while (!open.empty ()) {
    const std::size_t parent = open.back ();
    open.pop_back ();
    reached_[parent] = true;
    for (const int i : nodes[parent].children) {
      world_[std::size_t (i)] = world_[parent] * transform_of (nodes[std::size_t (i)]);
      open.push_back (std::size_t (i));
    }
  }
  return true;
}

bool
Reader::read_pictures ()
{
  for (auto &image : file_.images) {
    ModelPicture picture{path_ + ": image " + std::to_string (model_.pictures.size ()), {}};
    Bytes bytes;
    if (image.bufferView >= 0 && !view_bytes (image.bufferView, bytes))
      return false;
    if (image.bufferView >= 0)
      picture.bytes.assign (bytes.begin (), bytes.end ());
    else if (!image.image.empty ())
      picture.bytes = std::move (image.image);
    else
      picture.name = (fs::path (path_).parent_path () / image.uri).string ();
    model_.pictures.push_back (std::move (picture));
  }
  return true;
}

bool
Reader::read_texture (const tinygltf::TextureInfo &info, ModelMaterial &material)
{
  if (std::size_t (info.index) >= file_.textures.size ())
    return fail (StatusCode::kBadData, "a material names a texture that is missing");
  const tinygltf::Texture &texture = file_.textures[std::size_t (info.index)];
  if (texture.source < 0 && !texture.extensions.empty ())
    return fail_extension (texture.extensions.begin ()->first);
  if (texture.source < 0 || std::size_t (texture.source) >= model_.pictures.size ())
    return fail (StatusCode::kBadData, "a material's texture has no image");
  material.picture = texture.source;
  const tinygltf::Value change = extension (info.extensions, "KHR_texture_transform");
  material.coordinates = int (std::clamp (number_in (change, "texCoord", info.texCoord), 0., 9.));
  const double angle = number_in (change, "rotation", 0), x = number_in (change, "scale", 1, 0),
               y = number_in (change, "scale", 1, 1), c = std::cos (angle), s = std::sin (angle);
  material.transform = {c * x, s * y, number_in (change, "offset", 0, 0), -s * x, c * y,
      number_in (change, "offset", 0, 1)};
  if (texture.sampler < 0 || std::size_t (texture.sampler) >= file_.samplers.size ())
    return true;
  const auto wrap = [] (int mode) {
    return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? TextureWrap::kClamp
           : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? TextureWrap::kMirror
                                                           : TextureWrap::kRepeat;
  };
  const tinygltf::Sampler &sampler = file_.samplers[std::size_t (texture.sampler)];
  material.wrap_u = wrap (sampler.wrapS);
  material.wrap_v = wrap (sampler.wrapT);
  return true;
}

bool
Reader::read_materials ()
{
  for (const auto &from : file_.materials) {
    const auto &base = from.pbrMetallicRoughness;
    ModelMaterial material;
    if (base.baseColorTexture.index >= 0 && !read_texture (base.baseColorTexture, material))
      return false;
    for (std::size_t i = 0; i < std::min<std::size_t> (4, base.baseColorFactor.size ()); i++) {
      const double value = std::clamp (base.baseColorFactor[i], 0.0, 1.0);
      material.factor[i] = i < 3 ? displayed (value) : value;
    }
    material.has_colour = material.picture >= 0 || from.values.contains ("baseColorFactor");
    material.masked = from.alphaMode == "MASK" || from.alphaMode == "BLEND";
    if (from.alphaMode == "MASK")
      material.alpha_cutoff = std::clamp (from.alphaCutoff, 0.0, 1.0);
    material.double_sided = from.doubleSided;
    material.visible = number_in (extension (from.extensions, "KHR_materials_transmission"),
                           "transmissionFactor", 0) <= 0.5;
    model_.palette.push_back (material);
  }
  return true;
}

/* Draws the nodes of the scene that the file names, else of the first, else all. */
bool
Reader::read_scene ()
{
  const auto scene = std::size_t (std::max (0, file_.defaultScene));
  std::vector<int> open;
  for (std::size_t i = 0; i < file_.nodes.size () && scene >= file_.scenes.size (); i++)
    open.push_back (int (i));
  if (scene < file_.scenes.size ())
    open = file_.scenes[scene].nodes;
  std::vector<bool> drawn (file_.nodes.size (), false);
  while (!open.empty ()) {
    const auto i = std::size_t (open.back ());
    open.pop_back ();
    if (i >= drawn.size () || !reached_[i])
      return fail (StatusCode::kBadData, "a scene names a node that is missing or has no root");
    if (!drawn[i])
      open.insert (open.end (), file_.nodes[i].children.begin (), file_.nodes[i].children.end ());
    drawn[i] = true;
  }
  for (std::size_t i = 0; i < drawn.size (); i++)
    if (drawn[i] && !read_node_mesh (i))
      return false;
  return true;
}

bool
Reader::read_node_mesh (std::size_t index)
{
  const tinygltf::Node &node = file_.nodes[index];
  if (node.mesh < 0)
    return true;
  if (std::size_t (node.mesh) >= file_.meshes.size ())
    return fail (StatusCode::kBadData, "a node names a mesh that is missing");
  Affine world = world_[index];
  if (node.skin >= 0 && !read_skin (node.skin, world))
    return false;
  for (const Primitive &primitive : file_.meshes[std::size_t (node.mesh)].primitives)
    if (!read_primitive (primitive, world))
      return false;
  return true;
}

/* A mesh with a skin is drawn as it was bound: where its first joint moves it, whatever its node's
 * transform says (3.7.3.3). In the pose of binding all joints agree. */
bool
Reader::read_skin (int index, Affine &world)
{
  if (std::size_t (index) >= file_.skins.size () ||
      file_.skins[std::size_t (index)].joints.empty ())
    return fail (StatusCode::kBadData, "a node names a skin that is missing or has no joints");
  const tinygltf::Skin &skin = file_.skins[std::size_t (index)];
  const auto joint = std::size_t (skin.joints[0]);
  if (joint >= world_.size ())
    return fail (StatusCode::kBadData, "a skin names a node that is missing");
  world = world_[joint];
  if (skin.inverseBindMatrices < 0) /* absent: identities (5.28.1) */
    return true;
  Values inverse;
  if (!read (skin.inverseBindMatrices, inverse))
    return false;
  if (inverse.components != 16 || inverse.count == 0)
    return fail (StatusCode::kBadData, "a skin's matrices are missing");
  world = world * affine_of (inverse.numbers.data ());
  return true;
}

bool
Reader::read_primitive (const Primitive &primitive, const Affine &world)
{
  if (primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
      primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN)
    return fail (StatusCode::kUnsupported, "has strips or fans; export triangles");
  if (primitive.mode >= 0 && primitive.mode != TINYGLTF_MODE_TRIANGLES)
    return true; /* points and lines have no surface */
  if (primitive.material >= int (model_.palette.size ()))
    return fail (StatusCode::kBadData, "a mesh names a material that is missing");
  const int material = std::max (primitive.material, -1);
  const int coordinates = material < 0 ? 0 : model_.palette[std::size_t (material)].coordinates;
  Mesh mesh;
  if (!read_vertices (primitive, coordinates, world, mesh) ||
      !read_triangles (primitive, world.determinant () < 0, mesh))
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

bool
Reader::read_vertices (const Primitive &primitive, int coordinates, const Affine &to, Mesh &mesh)
{
  const auto &attributes = primitive.attributes;
  Values positions, normals, places, colours;
  const auto optional = [&] (const std::string &name, Values &values) {
    const auto found = attributes.find (name);
    if (found == attributes.end ())
      return true;
    if (!read (found->second, values))
      return false;
    if (values.count != positions.count || values.components < 2)
      return fail (StatusCode::kBadData, name + " does not fit the vertices");
    return true;
  };
  if (const auto found = attributes.find ("POSITION");
      !read (found == attributes.end () ? -1 : found->second, positions))
    return false;
  if (positions.count > kMaxModelVertices)
    return fail (StatusCode::kUnsupported, "more than 4 million vertices");
  if (positions.components != 3)
    return fail (StatusCode::kBadData, "POSITION is not of type VEC3");
  if (!optional ("NORMAL", normals) || !optional ("COLOR_0", colours) ||
      !optional ("TEXCOORD_" + std::to_string (coordinates), places))
    return false;
  const double sign = to.determinant () < 0 ? -1 : 1;
  for (std::size_t i = 0; i < positions.count; i++) {
    const float *p = positions.numbers.data () + 3 * i;
    MeshVertex vertex{};
    for (int k = 0; k < 3; k++)
      (&vertex.x)[k] =
          float (to.m[k][0] * p[0] + to.m[k][1] * p[1] + to.m[k][2] * p[2] + to.m[k][3]);
    if (normals.components == 3) {
      const float *n = normals.numbers.data () + 3 * i;
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
Reader::read_triangles (const Primitive &primitive, bool mirrored, Mesh &mesh)
{
  Values indices;
  indices.components = 1;
  if (primitive.indices < 0) {
    indices.count = mesh.vertices.size ();
    for (std::size_t i = 0; i < indices.count; i++)
      indices.numbers.push_back (float (i));
  } else if (!read (primitive.indices, indices)) {
    return false;
  }
  if (indices.components != 1 || !std::ranges::all_of (indices.numbers, [&] (float i) {
        return i >= 0 && i < float (mesh.vertices.size ());
      }))
    return fail (StatusCode::kBadData, "an index names a vertex that is missing");
  for (std::size_t i = 0; i + 2 < indices.count; i += 3) {
    const auto at = [&] (std::size_t k) { return std::uint32_t (indices.numbers[i + k]); };
    mesh.triangles.push_back ({at (0), at (mirrored ? 2 : 1), at (mirrored ? 1 : 2)});
  }
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
