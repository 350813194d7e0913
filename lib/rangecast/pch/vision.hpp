/* SPDX-License-Identifier: LGPL-2.1-or-later */
// Precompiled for the files of lib/rangecast that use OpenCV.
#pragma once
#include "core.hpp"
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
