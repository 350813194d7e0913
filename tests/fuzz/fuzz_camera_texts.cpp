/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as what stereocamsrc reads besides pictures: a features string, and a camera's answer
 * that holds its user-defined name. */
#include "camera/aravis/features.hpp"
#include "camera/aravis/user_name.hpp"
#include <algorithm>
#include <cstdlib>

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  const std::string text (data, data + size);
  std::vector<CameraFeature> features;
  const bool good = parse_camera_features (text, features).ok ();
  const bool named = std::ranges::none_of (
      features, [] (const CameraFeature &feature) { return feature.name.empty (); });
  if (!named || (!good && !features.empty ()))
    std::abort ();
  if (size >= 8) { /* asked with the number that it answers to */
    const auto name =
        user_name_in ({data, size}, static_cast<std::uint16_t> (data[6] << 8 | data[7]));
    if (name && name->size () > kUserNameSize)
      std::abort ();
  }
  return 0;
}
