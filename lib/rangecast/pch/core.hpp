/* SPDX-License-Identifier: LGPL-2.1-or-later */
// Precompiled for lib/rangecast: what most of its files include. Files include what they use all
// the same.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
