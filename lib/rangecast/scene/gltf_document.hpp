/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "../base/status.hpp"
#include "json.hpp"

namespace rangecast {

/** A glTF 2.0 file, JSON or binary, with its buffers: all that is below the meaning of meshes,
 *  materials and nodes. Functions that return bool leave the reason in status_ when it is false. */
class GltfDocument {
protected:
  using Bytes = std::span<const std::uint8_t>;

  /** The elements of an accessor. */
  struct Values {
    std::vector<float> numbers; ///< `components` for each element
    std::size_t count = 0;
    int components = 0;
  };

  /** @param storage  keeps the file's bytes and all that it refers to */
  GltfDocument (std::string path, std::vector<std::vector<std::uint8_t>> &storage)
      : path_ (std::move (path)), storage_ (storage)
  {
  }

  bool fail (StatusCode code, const std::string &what);
  bool fail_extension (const std::string &name);

  /** Reads the file and its buffers, and checks which extensions it requires. */
  bool load_document ();
  /** The bytes of a URI that lies beside the model, or of a data URI; kept in the storage.
   *  @param what  it is, for the error */
  bool load_uri (const std::string &uri, const char *what, Bytes &bytes);
  [[nodiscard]] std::string path_beside (const std::string &uri) const;
  bool view_bytes (int view, Bytes &bytes);
  bool read (int accessor, Values &values);

  const std::string path_;
  Status status_;
  Json root_;

private:
  bool open ();
  bool parse (Bytes text);
  bool check_extensions ();
  bool load_buffers ();
  bool read_block (const Json &from, int component_type, bool normalised, Values &values);
  bool read_sparse (const Json &sparse, int component_type, bool normalised, Values &values);

  std::vector<std::vector<std::uint8_t>> &storage_; ///< what lies in one stays where it is
  Bytes binary_;                                    ///< the second chunk
  std::vector<Bytes> buffers_;
  std::size_t elements_ = 0; ///< that accessors have given
};

} // namespace rangecast
