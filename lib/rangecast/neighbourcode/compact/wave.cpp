/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "wave.hpp"

namespace rangecast {

const WaveFunctions *
wave_functions ([[maybe_unused]] CpuLevel level)
{
#if defined __x86_64__
  if (level >= CpuLevel::kAvx2)
    return &kWaveFunctionsAvx2;
#endif
  return nullptr;
}

} // namespace rangecast
