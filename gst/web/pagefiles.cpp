/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pagefiles.hpp"

#include <gio/gio.h>
#include <glib/gstdio.h>

#include <algorithm>
#include <array>

namespace web {

namespace {

struct FileType {
  const char *suffix, *type;
};
constexpr std::array<FileType, 4> kFileTypes = {
    {{".html", "text/html; charset=utf-8"}, {".js", "text/javascript; charset=utf-8"},
        {".css", "text/css; charset=utf-8"}, {".wasm", "application/wasm"}}};

/* A name in the page's folder, without a path.
 * @return its type, or nullptr for any other name */
const char *
type_of (std::string_view name)
{
  const auto allowed = [] (char c) { return g_ascii_isalnum (c) || c == '-' || c == '.'; };
  if (name.empty () || name.front () == '.' || !std::ranges::all_of (name, allowed))
    return nullptr;
  for (const FileType &file : kFileTypes)
    if (name.ends_with (file.suffix))
      return file.type;
  return nullptr;
}

GBytes *
compress (GBytes *bytes)
{
  GConverter *compressor = G_CONVERTER (g_zlib_compressor_new (G_ZLIB_COMPRESSOR_FORMAT_GZIP, 6));
  GOutputStream *memory = g_memory_output_stream_new_resizable ();
  GOutputStream *stream = g_converter_output_stream_new (memory, compressor);
  gsize size = 0;
  const gconstpointer data = g_bytes_get_data (bytes, &size);
  g_output_stream_write_all (stream, data, size, nullptr, nullptr, nullptr);
  g_output_stream_close (stream, nullptr, nullptr);
  GBytes *compressed = g_memory_output_stream_steal_as_bytes (G_MEMORY_OUTPUT_STREAM (memory));
  g_object_unref (stream);
  g_object_unref (memory);
  g_object_unref (compressor);
  return compressed;
}

} // namespace

const PageFiles::File *
PageFiles::find (std::string_view path)
{
  const std::string name (path == "/"      ? "index.html"
                          : path == "/rig" ? "rig.html"
                                           : path.substr (1));
  const char *type = type_of (name);
  const std::string file_name = folder_ + "/" + name;
  GStatBuf status;
  if (!type || g_stat (file_name.c_str (), &status) != 0 || !S_ISREG (status.st_mode))
    return nullptr;
  const std::string etag = "\"" + std::to_string (status.st_mtim.tv_sec) + "-" +
                           std::to_string (status.st_mtim.tv_nsec) + "-" +
                           std::to_string (status.st_size) + "\"";
  File &file = files_[name];
  if (file.etag != etag) {
    gchar *contents = nullptr;
    gsize size = 0;
    if (!g_file_get_contents (file_name.c_str (), &contents, &size, nullptr))
      return nullptr;
    file = {type, etag, BytesPtr (g_bytes_new_take (contents, size)), nullptr};
    file.gzip.reset (compress (file.plain.get ()));
  }
  return &file;
}

} // namespace web
