/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace web {

struct BytesUnref {
  void operator() (GBytes *bytes) const { g_bytes_unref (bytes); }
};
using BytesPtr = std::unique_ptr<GBytes, BytesUnref>;

/** The files of the page, in memory as they are and compressed, read again when they change. One
 * thread. */
class PageFiles {
public:
  struct File {
    const char *type = nullptr; ///< media type
    std::string etag;           ///< changes with the file
    BytesPtr plain, gzip;
  };

  explicit PageFiles (std::string folder) : folder_ (std::move (folder)) {}
  /** @param path  of a request, from "/"
   *  @return nullptr if the page has no such file; valid until the next call */
  const File *find (std::string_view path);

private:
  std::string folder_;
  std::map<std::string, File, std::less<>> files_;
};

} // namespace web
