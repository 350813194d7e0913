/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as a rig blob: refused, or decoded to a valid rig that encodes to the same bytes. */
#include <algorithm>
#include <cstdlib>
#include <rangecast/geometry/rig.hpp>

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  rangecast::Rig rig;
  if (!rangecast::decode_rig ({data, size}, rig).ok ())
    return 0;
  if (!rangecast::validate (rig).ok ())
    std::abort ();
  const auto again = rangecast::encode_rig (rig);
  if (!std::equal (again.begin (), again.end (), data, data + size))
    std::abort ();
  return 0;
}
