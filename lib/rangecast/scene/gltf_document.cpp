/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* After the Khronos Group's glTF 2.0 specification (ISO/IEC 12113:2022); section numbers are its.
 */
#include "gltf_document.hpp"

#ifdef RANGECAST_HAVE_ASSIMP

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "gltf.hpp"
#include "texture.hpp"

namespace fs = std::filesystem;

namespace rangecast {
namespace {

constexpr std::size_t kMaxFile = std::size_t{1} << 30;
constexpr std::size_t kMaxCount = 3 * kMaxModelTriangles, kMaxElements = 256'000'000;
constexpr std::uint32_t kMagic = 0x46546c67, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;

/* Extensions that a file may require and that change nothing we draw, or that we read. */
constexpr std::string_view kReadExtensions[] = {"KHR_mesh_quantization", "KHR_texture_transform",
    "KHR_lights_punctual", "KHR_xmp_json_ld", "KHR_materials_*"};

int
hex_digit (char c)
{
  return c >= '0' && c <= '9'                 ? c - '0'
         : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10
                                              : -1;
}

std::string
percent_decoded (const std::string &uri)
{
  std::string path;
  for (std::size_t i = 0; i < uri.size (); i++)
    if (uri[i] == '%' && i + 2 < uri.size () && hex_digit (uri[i + 1]) >= 0 &&
        hex_digit (uri[i + 2]) >= 0) {
      path += char (hex_digit (uri[i + 1]) * 16 + hex_digit (uri[i + 2]));
      i += 2;
    } else {
      path += uri[i];
    }
  return path;
}

bool
decode_base64 (std::string_view text, std::vector<std::uint8_t> &bytes)
{
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::uint8_t values[256];
  std::fill (std::begin (values), std::end (values), std::uint8_t (255));
  for (std::size_t i = 0; i < kDigits.size (); i++)
    values[static_cast<unsigned char> (kDigits[i])] = static_cast<std::uint8_t> (i);
  unsigned bits = 0;
  int count = 0;
  bytes.reserve (text.size () / 4 * 3);
  while (!text.empty () && text.back () == '=')
    text.remove_suffix (1);
  for (const char c : text) {
    const unsigned value = values[static_cast<unsigned char> (c)];
    if (value > 63)
      return false;
    bits = bits << 6 | value;
    count += 6;
    if (count >= 8)
      bytes.push_back (static_cast<std::uint8_t> (bits >> (count -= 8)));
  }
  return true;
}

int
component_size (int type) /* 3.6.2.2 */
{
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      return 0;
  }
}

int
component_count (const std::string &type)
{
  return type == "SCALAR" ? 1
         : type == "VEC2" ? 2
         : type == "VEC3" ? 3
         : type == "VEC4" ? 4
         : type == "MAT4" ? 16
                          : 0;
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
    case 5120:
      return normalised ? std::max (float (load<std::int8_t> (from)) / 127, -1.f)
                        : float (load<std::int8_t> (from));
    case 5121:
      return float (*from) / (normalised ? 255.f : 1.f);
    case 5122:
      return normalised ? std::max (float (load<std::int16_t> (from)) / 32767, -1.f)
                        : float (load<std::int16_t> (from));
    case 5123:
      return float (load<std::uint16_t> (from)) / (normalised ? 65535.f : 1.f);
    case 5125:
      return float (load<std::uint32_t> (from));
    default:
      return load<float> (from);
  }
}

} // namespace

bool
GltfDocument::fail (StatusCode code, const std::string &what)
{
  status_ = {code, path_ + ": " + what};
  return false;
}

bool
GltfDocument::fail_extension (const std::string &name)
{
  return fail (StatusCode::kUnsupported, "needs the glTF extension " + name +
                                             ", which is not supported; expected a model that was "
                                             "exported without it");
}

bool
GltfDocument::load_document ()
{
  return open () && check_extensions () && load_buffers ();
}

bool
GltfDocument::open ()
{
  auto &bytes = storage_.emplace_back ();
  if (status_ = read_file (path_, kMaxFile, "a model (glTF or OBJ)", bytes); !status_.ok ())
    return false;
  const Bytes file = bytes;
  if (file.size () < 12 || load<std::uint32_t> (file.data ()) != kMagic)
    return parse (file);
  if (const auto version = load<std::uint32_t> (file.data () + 4); version != 2)
    return fail (StatusCode::kUnsupported,
        "binary glTF of version " + std::to_string (version) + "; expected 2");
  const std::size_t length = load<std::uint32_t> (file.data () + 8);
  const auto truncated = [&] (std::size_t expected) {
    return fail (StatusCode::kTruncated, "ends after " + std::to_string (file.size ()) +
                                             " bytes; expected " + std::to_string (expected));
  };
  if (length > file.size ())
    return truncated (length);
  Bytes text;
  for (std::size_t at = 12; at + 8 <= length;) { /* 4.4.3 */
    const std::size_t size = load<std::uint32_t> (file.data () + at);
    const auto type = load<std::uint32_t> (file.data () + at + 4);
    at += 8;
    if (size > length - at)
      return truncated (at + size);
    if (type == kJsonChunk && text.empty ())
      text = file.subspan (at, size);
    else if (type == kBinaryChunk && binary_.empty ())
      binary_ = file.subspan (at, size);
    at += size;
  }
  return parse (text);
}

bool
GltfDocument::parse (Bytes text)
{
  const Status parsed =
      parse_json ({reinterpret_cast<const char *> (text.data ()), text.size ()}, root_);
  if (parsed.code () == StatusCode::kUnsupported)
    return fail (parsed.code (), parsed.message ());
  if (!parsed.ok () || root_["asset"].is_null ())
    return fail (StatusCode::kBadData, "cannot be read as a model; expected glTF 2.0");
  if (const std::string &version = root_["asset"]["version"].text; !version.starts_with ("2"))
    return fail (StatusCode::kUnsupported, "glTF of version " + version + "; expected 2.0");
  return true;
}

bool
GltfDocument::check_extensions ()
{
  for (const Json &name : root_["extensionsRequired"].items) {
    const bool known = std::ranges::any_of (kReadExtensions, [&] (std::string_view pattern) {
      return pattern.ends_with ('*')
                 ? name.text.starts_with (pattern.substr (0, pattern.size () - 1))
                 : name.text == pattern;
    });
    if (!known)
      return fail_extension (name.text);
  }
  return true;
}

bool
GltfDocument::load_uri (const std::string &uri, const char *what, Bytes &bytes)
{
  auto &loaded = storage_.emplace_back ();
  if (uri.starts_with ("data:")) {
    const auto comma = uri.find (";base64,");
    if (comma == std::string::npos ||
        !decode_base64 (std::string_view (uri).substr (comma + 8), loaded))
      return fail (StatusCode::kBadData, std::string (what) + " is a data URI; expected base64");
    bytes = loaded;
    return true;
  }
  if (uri.find ("://") != std::string::npos)
    return fail (StatusCode::kUnsupported,
        std::string (what) + " is at " + uri.substr (0, 80) + "; expected a file beside the model");
  status_ = read_file (path_beside (uri), kMaxFile, what, loaded);
  bytes = loaded;
  return status_.ok ();
}

std::string
GltfDocument::path_beside (const std::string &uri) const
{
  return (fs::path (path_).parent_path () / percent_decoded (uri)).string ();
}

bool
GltfDocument::load_buffers ()
{
  const Json &buffers = root_["buffers"];
  std::size_t total = 0;
  for (std::size_t i = 0; i < buffers.size (); i++) {
    const Json &uri = buffers[i]["uri"];
    const std::string name = "buffer " + std::to_string (i);
    if (uri.is_null () && i == 0 && !binary_.empty ()) {
      buffers_.push_back (binary_);
    } else if (uri.is_null ()) {
      buffers_.emplace_back (); /* filled by an extension; an error where it is used */
      continue;
    } else if (!load_uri (uri.text, "a buffer of a glTF model", buffers_.emplace_back ())) {
      return false;
    }
    const std::size_t length = buffers[i]["byteLength"].size_or (0);
    if (buffers_[i].size () < length)
      return fail (StatusCode::kTruncated, name + " has " + std::to_string (buffers_[i].size ()) +
                                               " bytes; expected " + std::to_string (length));
    if (total += buffers_[i].size (); total > 2 * kMaxFile)
      return fail (StatusCode::kUnsupported, "buffers of more than 2 GiB");
  }
  return true;
}

bool
GltfDocument::view_bytes (int index, Bytes &bytes)
{
  const Json &view = root_["bufferViews"][std::size_t (index)];
  const auto buffer = std::size_t (view["buffer"].index ());
  const std::size_t offset = view["byteOffset"].size_or (0),
                    length = view["byteLength"].size_or (0);
  if (index < 0 || buffer >= buffers_.size ())
    return fail (StatusCode::kBadData, "buffer view " + std::to_string (index) + " has no buffer");
  if (buffers_[buffer].empty () && !view["extensions"].names.empty ())
    return fail_extension (view["extensions"].names[0]);
  if (offset > buffers_[buffer].size () || length > buffers_[buffer].size () - offset)
    return fail (StatusCode::kBadData,
        "buffer view " + std::to_string (index) + " reaches beyond its buffer");
  bytes = buffers_[buffer].subspan (offset, length);
  return true;
}

/* Requires count and components of `values`. */
bool
GltfDocument::read_block (const Json &from, int component_type, bool normalised, Values &values)
{
  const int view = from["bufferView"].index ();
  Bytes bytes;
  if (!view_bytes (view, bytes))
    return false;
  const auto component_bytes = std::size_t (component_size (component_type));
  const std::size_t element = component_bytes * std::size_t (values.components);
  const std::size_t stride =
      root_["bufferViews"][std::size_t (view)]["byteStride"].size_or (element);
  const std::size_t offset = from["byteOffset"].size_or (0);
  const bool fits =
      element > 0 && stride >= element && stride <= 65536 && offset <= bytes.size () &&
      (values.count == 0 || (values.count - 1) * stride + element <= bytes.size () - offset);
  if (!fits)
    return fail (
        StatusCode::kBadData, "an accessor reaches beyond buffer view " + std::to_string (view));
  values.numbers.resize (values.count * std::size_t (values.components));
  float *to = values.numbers.data ();
  for (std::size_t i = 0; i < values.count; i++)
    for (std::size_t c = 0; c < std::size_t (values.components); c++)
      *to++ = component (
          bytes.data () + offset + i * stride + c * component_bytes, component_type, normalised);
  return true;
}

bool
GltfDocument::read_sparse (const Json &sparse, int component_type, bool normalised, Values &values)
{
  Values places, changes;
  places.count = changes.count = sparse["count"].size_or (0);
  places.components = 1;
  changes.components = values.components;
  if (places.count > values.count)
    return fail (StatusCode::kBadData, "a sparse accessor with more changes than elements");
  if (!read_block (sparse["indices"], sparse["indices"]["componentType"].index (), false, places) ||
      !read_block (sparse["values"], component_type, normalised, changes))
    return false;
  const auto n = std::size_t (values.components);
  for (std::size_t i = 0; i < places.count; i++) {
    const float place = places.numbers[i];
    if (!(place >= 0 && place < float (values.count)))
      return fail (StatusCode::kBadData, "a sparse accessor changes an element that is not there");
    std::copy_n (changes.numbers.begin () + std::ptrdiff_t (i * n), n,
        values.numbers.begin () + std::ptrdiff_t (std::size_t (place) * n));
  }
  return true;
}

bool
GltfDocument::read (int index, Values &values)
{
  const Json &accessor = root_["accessors"][std::size_t (index)];
  const int type = accessor["componentType"].index ();
  const bool normalised = accessor["normalized"].number != 0;
  values.count = accessor["count"].size_or (0);
  values.components = component_count (accessor["type"].text);
  if (elements_ += values.count; elements_ > kMaxElements) /* primitives may share accessors */
    return fail (StatusCode::kUnsupported, "accessors of more than 256 million elements");
  if (index < 0 || values.components == 0 || component_size (type) == 0 || values.count > kMaxCount)
    return fail (StatusCode::kBadData,
        "accessor " + std::to_string (index) + " is missing or of an unknown type or size");
  const Json &sparse = accessor["sparse"];
  if (accessor["bufferView"].is_null () && !sparse.is_null ())
    values.numbers.assign (values.count * std::size_t (values.components), 0.f);
  else if (accessor["bufferView"].is_null ())
    return fail (StatusCode::kBadData, "accessor " + std::to_string (index) + " has no data");
  else if (!read_block (accessor, type, normalised, values))
    return false;
  return sparse.is_null () || read_sparse (sparse, type, normalised, values);
}

bool
is_gltf (const std::string &path)
{
  std::string ending = fs::path (path).extension ().string ();
  std::ranges::transform (
      ending, ending.begin (), [] (unsigned char c) { return std::tolower (c); });
  std::ifstream file (path, std::ios::binary);
  std::uint32_t magic = 0;
  file.read (reinterpret_cast<char *> (&magic), sizeof magic);
  return ending == ".gltf" || ending == ".glb" || magic == kMagic;
}

} // namespace rangecast

#endif
