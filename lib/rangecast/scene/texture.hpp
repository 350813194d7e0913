/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "../base/status.hpp"
#include "mesh.hpp"

namespace rangecast {

/** How a picture becomes a texture. */
struct TextureSettings {
  int max_side = 2048;             ///< pixels: a larger picture is made smaller
  double factor[4] = {1, 1, 1, 1}; ///< R, G, B (as displayed, not linear) and alpha
  std::uint8_t alpha_cutoff = 0;   ///< see Mesh; 0: alpha is ignored
};

/** Decodes JPEG or PNG, of at most 2^30 pixels (OpenCV's limit).
 *  @param name  of the image, for the error
 *  @return kBadData naming the image */
Status decode_texture (std::span<const std::uint8_t> bytes, const std::string &name,
    const TextureSettings &settings, std::shared_ptr<const MipMap> &texture);

/** The same from a file of at most 256 MiB. @return kNotFound too */
Status read_texture (const std::string &path, const TextureSettings &settings,
    std::shared_ptr<const MipMap> &texture);

/** Reads a file whole. @return kNotFound naming it, kUnsupported if it is larger than the limit */
Status read_file (
    const std::string &path, std::size_t limit, const char *what, std::vector<std::uint8_t> &bytes);

} // namespace rangecast
