/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any text as a rig file: refused, or read as a valid rig, which its blob keeps. What is no YAML or
 * JSON ends in libyaml, so this needs its dictionary and seeds. */
#include <cstdlib>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/rigfile/rig_file.hpp>

#include "memory_file.hpp"

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static const MemoryFile file ("rig.yaml");
  file.fill ({data, size});
  rangecast::Rig rig, again;
  if (!rangecast::load_rig (file.path (), rig).ok ())
    return 0;
  if (!rangecast::validate (rig).ok ())
    std::abort ();
  const auto blob = rangecast::encode_rig (rig);
  if (!rangecast::decode_rig (blob, again).ok () || rangecast::encode_rig (again) != blob)
    std::abort ();
  return 0;
}
