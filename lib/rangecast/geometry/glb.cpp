/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "glb.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>

namespace rangecast {
namespace {

/* Neighbours are joined up to this difference of their depths, as a share of the smaller one. */
constexpr float kDepthStep = 0.03f;

constexpr std::uint32_t kMagic = 0x46546c67, kVersion = 2, kJson = 0x4e4f534a, kBinary = 0x004e4942;

struct Vertex {
  float xyz[3];
  std::uint16_t rgba[4];
};

struct Mesh {
  std::vector<Vertex> vertices;
  std::vector<std::uint32_t> indices;
};

/* sRGB levels as 16 bits of linear light (IEC 61966-2-1). */
std::array<std::uint16_t, 256>
linear_light ()
{
  std::array<std::uint16_t, 256> table;
  for (std::size_t i = 0; i < table.size (); i++) {
    const double v = static_cast<double> (i) / 255;
    const double linear = v <= 0.04045 ? v / 12.92 : std::pow ((v + 0.055) / 1.055, 2.4);
    table[i] = static_cast<std::uint16_t> (std::lround (65535 * linear));
  }
  return table;
}

void
add_image (const RangeImage &image, const View &view, Mesh &mesh)
{
  static const auto linear = linear_light ();
  const auto &depth = image.depth;
  std::vector<std::uint32_t> rows[2]; /* indices of the vertices of the row above and of this one */
  rows[0].resize (static_cast<std::size_t> (depth.width));
  rows[1] = rows[0];
  const auto join = [&] (int ax, int ay, int bx, int by, int cx, int cy, int y) {
    const auto [min, max] = std::minmax ({depth.at (ax, ay), depth.at (bx, by), depth.at (cx, cy)});
    if (min == kInvalidDepth || float (max - min) > kDepthStep * float (min))
      return;
    const auto index = [&] (
                           int x, int row) { return rows[row == y][static_cast<std::size_t> (x)]; };
    mesh.indices.insert (mesh.indices.end (), {index (ax, ay), index (bx, by), index (cx, cy)});
  };
  for (int y = 0; y < depth.height; y++) {
    std::swap (rows[0], rows[1]);
    for (int x = 0; x < depth.width; x++) {
      if (depth.at (x, y) == kInvalidDepth)
        continue;
      const Vec3 at =
          view.world_from_view * view.intrinsics.unproject (x + image.roi.x, y + image.roi.y,
                                     depth.at (x, y) * view.depth_unit_m);
      const Rgbx c = image.colour.at (x, y);
      rows[1][static_cast<std::size_t> (x)] = static_cast<std::uint32_t> (mesh.vertices.size ());
      mesh.vertices.push_back ({{float (at.x), float (at.y), float (at.z)},
          {linear[c.r], linear[c.g], linear[c.b], 65535}});
    }
    for (int x = 1; x < depth.width && y > 0; x++) { /* counter-clockwise as the camera sees them */
      join (x - 1, y - 1, x - 1, y, x, y - 1, y);
      join (x, y - 1, x - 1, y, x, y, y);
    }
  }
}

/* Three numbers, in any locale. */
std::string
numbers (const float *xyz)
{
  std::string text;
  for (int i = 0; i < 3; i++) {
    char digits[32];
    const auto end = std::to_chars (digits, digits + sizeof digits, xyz[i]).ptr;
    text.append (i ? "," : "").append (digits, end);
  }
  return text;
}

std::string
json_of (const Mesh &mesh)
{
  std::string text = R"({"asset":{"version":"2.0","generator":"gst-rangecast"},"scene":0,)";
  if (mesh.vertices.empty ())
    return text + R"("scenes":[{}]})";
  float min[3], max[3];
  for (int i = 0; i < 3; i++) {
    const auto [low, high] = std::ranges::minmax_element (
        mesh.vertices, {}, [i] (const Vertex &vertex) { return vertex.xyz[i]; });
    min[i] = low->xyz[i];
    max[i] = high->xyz[i];
  }
  const bool joined = !mesh.indices.empty ();
  const std::size_t vertices = mesh.vertices.size (), indices = mesh.indices.size ();
  const std::string vertex_bytes = std::to_string (sizeof (Vertex) * vertices),
                    index_bytes = std::to_string (4 * indices), n = std::to_string (vertices);
  text += R"("scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{)"
          R"("attributes":{"POSITION":0,"COLOR_0":1},"material":0,"mode":)";
  text += joined ? R"(4,"indices":2}]}],)" : "0}]}],";
  text += R"("extensionsUsed":["KHR_materials_unlit"],)"
          R"("materials":[{"extensions":{"KHR_materials_unlit":{}}}],"accessors":[)"
          R"({"bufferView":0,"componentType":5126,"type":"VEC3","count":)" +
          n + R"(,"min":[)" + numbers (min) + R"(],"max":[)" + numbers (max) + "]}," +
          R"({"bufferView":0,"byteOffset":12,"componentType":5123,"normalized":true,)"
          R"("type":"VEC4","count":)" +
          n + "}";
  if (joined)
    text += R"(,{"bufferView":1,"componentType":5125,"type":"SCALAR","count":)" +
            std::to_string (indices) + "}";
  text += R"(],"bufferViews":[{"buffer":0,"byteStride":20,"target":34962,"byteLength":)" +
          vertex_bytes + "}";
  if (joined)
    text += R"(,{"buffer":0,"target":34963,"byteOffset":)" + vertex_bytes + R"(,"byteLength":)" +
            index_bytes + "}";
  return text + R"(],"buffers":[{"byteLength":)" +
         std::to_string (sizeof (Vertex) * vertices + 4 * indices) + "}]}";
}

} // namespace

Status
write_glb (std::span<const RangeImage> images, const Rig &rig, std::vector<std::uint8_t> &out)
{
  Mesh mesh;
  for (const RangeImage &image : images) {
    const View *view = rig.find (image.view_id);
    if (!view)
      return {StatusCode::kNotFound, "glTF: the rig has no view " + std::to_string (image.view_id)};
    add_image (image, *view, mesh);
  }
  std::string json = json_of (mesh);
  json.resize ((json.size () + 3) / 4 * 4, ' ');
  const std::size_t vertex_bytes = sizeof (Vertex) * mesh.vertices.size (),
                    binary = vertex_bytes + 4 * mesh.indices.size (),
                    size = 20 + json.size () + (binary > 0 ? 8 + binary : 0);
  if (size > UINT32_MAX)
    return {StatusCode::kBadSize, "glTF: a file cannot exceed 4 GiB"};
  out.clear ();
  out.reserve (size);
  const auto add = [&out] (const void *data, std::size_t bytes) {
    const auto from = static_cast<const std::uint8_t *> (data);
    out.insert (out.end (), from, from + bytes);
  };
  const std::uint32_t head[] = {
      kMagic, kVersion, std::uint32_t (size), std::uint32_t (json.size ()), kJson};
  add (head, sizeof head);
  add (json.data (), json.size ());
  if (binary > 0) {
    const std::uint32_t chunk[] = {std::uint32_t (binary), kBinary};
    add (chunk, sizeof chunk);
    add (mesh.vertices.data (), vertex_bytes);
    add (mesh.indices.data (), 4 * mesh.indices.size ());
  }
  return {};
}

} // namespace rangecast
