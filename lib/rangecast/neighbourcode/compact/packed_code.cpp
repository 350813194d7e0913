/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "packed_code.hpp"

namespace rangecast {
namespace {

/* Canonical codes: shorter ones first, equal lengths in the order of the symbols. Their first bit
 * comes first, so the bits are turned round to be written from the least significant one. */
template <std::size_t N>
std::array<PrefixCode, N>
codes_of (const std::array<std::uint8_t, N> &lengths)
{
  std::array<PrefixCode, N> codes{};
  std::uint32_t next = 0;
  for (std::uint8_t length = 1; length <= kMaxPatternBits; length++, next <<= 1)
    for (std::size_t symbol = 0; symbol < N; symbol++)
      if (lengths[symbol] == length) {
        codes[symbol].length = length;
        for (int i = 0; i < length; i++)
          codes[symbol].bits |= static_cast<std::uint16_t> ((next >> i & 1) << (length - 1 - i));
        next++;
      }
  return codes;
}

/* For every number that may come next, the symbol whose code it begins with. */
template <std::size_t N, std::size_t Size>
void
invert (const std::array<PrefixCode, N> &codes, std::array<PackedTables::Entry, Size> &table)
{
  table.fill ({});
  for (std::size_t symbol = 0; symbol < N; symbol++)
    if (codes[symbol].length > 0)
      for (std::size_t i = codes[symbol].bits; i < Size;
           i += std::size_t{1} << codes[symbol].length)
        table[i] = {static_cast<std::uint8_t> (symbol), codes[symbol].length};
}

/* Sign and size of residuals, as PackedWriter::long_residual() writes them. */
void
build_quick (PackedTables &tables, std::size_t order)
{
  auto &codes = tables.quick[order];
  auto &entries = tables.quick_of[order];
  codes[kMaxQuickSize] = {0, 0};
  for (std::uint32_t size = 1; size <= (1u << kQuickBits); size++) {
    const GolombCode code (size - 1, static_cast<int> (order));
    const int length = code.length + 1;
    for (std::uint32_t sign = 0; sign < 2; sign++) {
      const auto residual = static_cast<std::int32_t> (sign ? -size : size);
      const std::uint64_t bits = code.bits << 1 | sign;
      if (size <= kMaxQuickSize)
        codes[static_cast<std::size_t> (residual + kMaxQuickSize)] = {
            static_cast<std::uint32_t> (bits), static_cast<std::uint32_t> (length)};
      if (length <= kQuickBits)
        for (std::uint64_t i = bits; i < entries.size (); i += std::uint64_t{1} << length)
          entries[i] = {static_cast<std::int16_t> (residual), static_cast<std::uint16_t> (length)};
    }
  }
}

PackedTables
build ()
{
  PackedTables tables;
  for (std::size_t i = 0; i < kPackedContexts; i++) {
    tables.choice[i] = codes_of (kChoiceLengths[i]);
    invert (tables.choice[i], tables.choice_of[i]);
  }
  for (std::size_t i = 0; i < kPatternCodes; i++) {
    tables.pattern[i] = codes_of (kPatternLengths[i]);
    invert (tables.pattern[i], tables.pattern_of[i]);
  }
  for (std::size_t order = 0; order < tables.quick.size (); order++)
    build_quick (tables, order);
  return tables;
}

} // namespace

/* clang-format off */
const std::array<std::array<std::uint8_t, kChoices>, kPackedContexts> kChoiceLengths = {{
    {0, 2, 0, 0, 2, 1}, {1, 3, 0, 0, 3, 2}, {3, 2, 0, 0, 3, 1}, {2, 3, 0, 0, 3, 1},
    {0, 2, 3, 0, 3, 1}, {1, 3, 4, 0, 4, 2}, {1, 3, 4, 0, 4, 2}, {1, 3, 4, 0, 4, 2},
    {0, 2, 3, 0, 3, 1}, {1, 4, 2, 0, 4, 3}, {3, 4, 1, 0, 4, 2}, {4, 4, 2, 0, 3, 1},
    {0, 3, 2, 0, 3, 1}, {1, 4, 3, 0, 4, 2}, {3, 4, 2, 0, 4, 1}, {4, 4, 3, 0, 2, 1},
    {0, 1, 0, 2, 3, 3}, {1, 2, 0, 3, 4, 4}, {1, 2, 0, 3, 4, 4}, {1, 2, 0, 3, 4, 4},
    {0, 2, 4, 4, 3, 1}, {1, 3, 5, 5, 4, 2}, {1, 3, 5, 5, 4, 2}, {1, 3, 5, 5, 4, 2},
    {0, 4, 1, 4, 3, 2}, {1, 4, 2, 5, 5, 3}, {1, 4, 2, 5, 5, 3}, {1, 5, 2, 5, 4, 3},
    {0, 4, 2, 4, 3, 1}, {1, 5, 2, 5, 4, 3}, {1, 5, 3, 5, 4, 2}, {1, 5, 3, 5, 4, 2},
    {0, 3, 0, 2, 3, 1}, {1, 3, 0, 3, 3, 3}, {3, 2, 0, 4, 4, 1}, {3, 4, 0, 2, 4, 1},
    {0, 2, 4, 4, 3, 1}, {1, 3, 5, 2, 5, 4}, {1, 4, 5, 2, 5, 3}, {1, 2, 5, 4, 5, 3},
    {0, 4, 2, 3, 4, 1}, {2, 3, 2, 4, 4, 2}, {3, 4, 1, 3, 4, 3}, {3, 3, 2, 3, 3, 2},
    {0, 4, 2, 3, 4, 1}, {2, 3, 2, 4, 4, 2}, {2, 4, 2, 3, 4, 2}, {4, 5, 2, 5, 3, 1},
    {0, 3, 0, 2, 3, 1}, {2, 4, 0, 3, 4, 1}, {4, 2, 0, 3, 4, 1}, {2, 4, 0, 3, 4, 1},
    {0, 2, 4, 3, 4, 1}, {1, 4, 5, 3, 5, 2}, {1, 4, 5, 3, 5, 2}, {1, 3, 5, 4, 5, 2},
    {0, 4, 3, 2, 4, 1}, {2, 4, 2, 3, 4, 2}, {2, 4, 2, 3, 4, 2}, {3, 4, 3, 4, 3, 1},
    {0, 4, 2, 3, 4, 1}, {2, 4, 2, 4, 3, 2}, {3, 4, 3, 4, 3, 1}, {3, 4, 3, 4, 3, 1},
}};
const std::array<std::array<std::uint8_t, 16>, kPatternCodes> kPatternLengths = {{
    {7, 3, 2, 2, 5, 4, 4, 4, 7, 6, 6, 6, 6, 6, 5, 5},
    {7, 6, 6, 6, 6, 5, 4, 3, 7, 6, 5, 5, 4, 4, 2, 2},
}};
/* clang-format on */

const PackedTables &
packed_tables ()
{
  static const PackedTables tables = build ();
  return tables;
}

} // namespace rangecast
