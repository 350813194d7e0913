/* SPDX-License-Identifier: LGPL-2.1-or-later */
// Precompiled for the elements of a plugin: what most of their files include. Files include what
// they use all the same.
#pragma once
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <gst/base/base.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>
