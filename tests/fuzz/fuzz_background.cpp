/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any text as a background file of roiextract: refused, or read as backgrounds that can be used. */
#include <cstdlib>
#include <rangecast/roi/background.hpp>

#include "memory_file.hpp"

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static const MemoryFile file ("background.yaml");
  file.fill ({data, size});
  std::vector<std::pair<int, rangecast::BackgroundModel>> views;
  if (!rangecast::load_backgrounds (file.path (), views).ok ())
    return 0;
  for (const auto &[id, model] : views)
    if (id < 0 || id >= rangecast::kMaxViews || !model.covers ({0, 0, 1, 1}))
      std::abort ();
  return 0;
}
