/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "model.hpp"

namespace rangecast {

Status
load_model (const std::string &path, const std::string &, Mesh &)
{
  return {StatusCode::kUnsupported,
      path + ": this version loads no models; expected no location (the built-in figure)"};
}

} // namespace rangecast
