/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Makes small glTF files, right and wrong ones. */
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <string>
#include <vector>

namespace rangecast::testing {

class GlbWriter {
public:
  /** Members of the root object beside those that are made here, each with a comma behind it. */
  std::string extra;
  std::string scene_nodes; ///< "0,1"; empty: all nodes

  template <typename T> int add_view (const std::vector<T> &data)
  {
    const std::size_t size = data.size () * sizeof (T);
    append (views_, R"({"buffer":0,"byteOffset":)" + std::to_string (binary_.size ()) +
                        R"(,"byteLength":)" + std::to_string (size) + "}");
    binary_.append (reinterpret_cast<const char *> (data.data ()), size);
    binary_.resize ((binary_.size () + 3) / 4 * 4);
    return n_views_++;
  }

  /** @param more  further members, each with a comma before it */
  template <typename T>
  int add_accessor (const std::vector<T> &data, int component_type, const char *type,
      std::size_t count, const std::string &more = "")
  {
    return add_bare_accessor (R"("bufferView":)" + std::to_string (add_view (data)) +
                              R"(,"componentType":)" + std::to_string (component_type) +
                              R"(,"type":")" + type + R"(","count":)" + std::to_string (count) +
                              more);
  }

  int add_bare_accessor (const std::string &members)
  {
    append (accessors_, "{" + members + "}");
    return n_accessors_++;
  }

  int add_floats (const std::vector<float> &data, const char *type, std::size_t count)
  {
    return add_accessor (data, 5126, type, count);
  }

  /** A picture and a texture of it. @param bytes  of a PNG or JPEG file */
  int add_texture (const std::vector<std::uint8_t> &bytes)
  {
    append (images_,
        R"({"mimeType":"image/png","bufferView":)" + std::to_string (add_view (bytes)) + "}");
    return add_bare_texture (R"("source":)" + std::to_string (n_images_++));
  }

  int add_bare_texture (const std::string &members)
  {
    append (textures_, "{" + members + "}");
    return n_textures_++;
  }

  int add_material (const std::string &members)
  {
    append (materials_, "{" + members + "}");
    return n_materials_++;
  }

  int add_textured_material (int texture, const std::string &more = "")
  {
    return add_material (R"("pbrMetallicRoughness":{"baseColorTexture":{"index":)" +
                         std::to_string (texture) + "}}" + more);
  }

  int add_mesh (const std::string &primitive)
  {
    append (meshes_, R"({"primitives":[{)" + primitive + "}]}");
    return n_meshes_++;
  }

  /** A square that faces +z, of corners (x - half, y - half, z) to (x + half, y + half, z); its
   *  texture's top is above. @return the mesh */
  int add_square (
      float x, float y, float z, float half, int material, const std::string &attributes = "")
  {
    const int position = add_floats ({x - half, y - half, z, x + half, y - half, z, x + half,
                                         y + half, z, x - half, y + half, z},
        "VEC3", 4);
    const int place = add_floats ({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2", 4);
    return add_square_of (
        position, R"(,"TEXCOORD_0":)" + std::to_string (place) + attributes, material);
  }

  /** The same of given accessors. @param attributes  with a comma before each */
  int add_square_of (int position, const std::string &attributes, int material)
  {
    const int indices =
        add_accessor (std::vector<std::uint16_t>{0, 1, 2, 0, 2, 3}, 5123, "SCALAR", 6);
    return add_mesh (R"("attributes":{"POSITION":)" + std::to_string (position) + attributes + "}" +
                     R"(,"indices":)" + std::to_string (indices) +
                     (material < 0 ? "" : R"(,"material":)" + std::to_string (material)));
  }

  int add_node (const std::string &members)
  {
    append (nodes_, "{" + members + "}");
    return n_nodes_++;
  }

  int add_mesh_node (int mesh, const std::string &more = "")
  {
    return add_node (R"("mesh":)" + std::to_string (mesh) + more);
  }

  [[nodiscard]] std::string json () const
  {
    std::string all = scene_nodes;
    for (int i = 0; scene_nodes.empty () && i < n_nodes_; i++)
      append (all, std::to_string (i));
    const auto list = [] (const char *name, const std::string &items) {
      return items.empty () ? "" : "\"" + std::string (name) + "\":[" + items + "],";
    };
    return R"({"asset":{"version":"2.0"},)" + extra + R"("scene":0,"scenes":[{"nodes":[)" + all +
           "]}]," + list ("nodes", nodes_) + list ("meshes", meshes_) +
           list ("materials", materials_) + list ("textures", textures_) +
           list ("images", images_) + list ("accessors", accessors_) +
           list ("bufferViews", views_) + R"("buffers":[{"byteLength":)" +
           std::to_string (binary_.size ()) + "}]}";
  }

  [[nodiscard]] std::string glb () const
  {
    std::string text = json ();
    text.resize ((text.size () + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    put (file, 2);
    put (file, std::uint32_t (12 + 8 + text.size () + 8 + binary_.size ()));
    put (file, std::uint32_t (text.size ()));
    file += "JSON" + text;
    put (file, std::uint32_t (binary_.size ()));
    file += std::string ("BIN\0", 4) + binary_;
    return file;
  }

private:
  static void append (std::string &list, const std::string &item)
  {
    list += (list.empty () ? "" : ",") + item;
  }
  static void put (std::string &file, std::uint32_t value)
  {
    file.append (reinterpret_cast<const char *> (&value), sizeof value);
  }

  std::string binary_, views_, accessors_, images_, textures_, materials_, meshes_, nodes_;
  int n_views_ = 0, n_accessors_ = 0, n_images_ = 0, n_textures_ = 0, n_materials_ = 0,
      n_meshes_ = 0, n_nodes_ = 0;
};

} // namespace rangecast::testing
