/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "entropy_code.hpp"

#include "entropy_tables.hpp"

namespace rangecast {

const std::array<std::uint16_t, (kFrequencySum >> RansEncoder::kCostShift)> RansEncoder::kCosts =
    [] {
      std::array<std::uint16_t, (kFrequencySum >> kCostShift)> costs{};
      for (std::size_t i = 0; i < costs.size (); i++) {
        const std::size_t least = std::max<std::size_t> (i << kCostShift, kMinFrequency);
        const double p = double (least) / kFrequencySum;
        costs[i] =
            static_cast<std::uint16_t> (std::ceil (kCostOfBit * (max_excess (p) - std::log2 (p))));
      }
      return costs;
    }();

namespace {

/* Three hexadecimal digits a start, in 1/4096. */
template <int kSymbols>
const char *
read_model (const char *from, SymbolModel<kSymbols> &model)
{
  const auto digit = [] (char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  model.starts[0] = 0;
  for (int i = 1; i < kSymbols; i++, from += 3)
    model.starts[i] = static_cast<std::uint16_t> (
        (digit (from[0]) << 8 | digit (from[1]) << 4 | digit (from[2])) << 3);
  model.starts[kSymbols] = kFrequencySum;
  return from;
}

EntropyModel
read_model (const char *choices, const char *numbers, bool key)
{
  EntropyModel model;
  for (std::size_t i = 0; i < kChoiceContexts; i++) {
    model.choices[i] = model.choices[0];
    const std::size_t left = i % kPixelClasses, upper = i / kPixelClasses;
    const bool occurs = left < kEarlierClass && upper % kUpperGroups < kEarlierGroup &&
                        upper / kUpperGroups < kEarlierGroup;
    if (occurs || !key)
      choices = read_model (choices, model.choices[i]);
  }
  for (auto &of_number : model.residuals)
    for (NumberModel &residual : of_number)
      numbers = read_model (numbers, residual);
  for (NumberModel &run : model.runs)
    numbers = read_model (numbers, run);
  const auto read_motion = [&] (NumberModel &motion) {
    motion = model.runs[0]; /* slices with key have none */
    if (*numbers != 0)
      numbers = read_model (numbers, motion);
  };
  read_motion (model.motion_change);
  for (NumberModel &motion : model.motions)
    read_motion (motion);
  return model;
}

const auto kInitialModels = [] {
  std::array<EntropyModel, kEntropyTables> models;
  for (std::size_t i = 0; i < models.size (); i++)
    models[i] = read_model (kInitialChoices[i], kInitialNumbers[i], i + 1 < kEntropyTables);
  return models;
}();

} // namespace

const EntropyModel &
initial_model (bool key, Components steps)
{
  return kInitialModels[!key ? 2 : is_zero (steps - 1) ? 0 : 1];
}

} // namespace rangecast
