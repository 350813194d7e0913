/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/base/status.hpp>
#include <rangecast/geometry/rig.hpp>

/** Checks that the views of a stream are cameras of the expected rig, with the same pose and focal
 *  length. The expected rig may hold range views or stereo pairs, also of other image sizes with
 *  the same aspect ratio.
 *  @return kBadValue that names the difference */
rangecast::Status check_rig (const rangecast::Rig &stream, const rangecast::Rig &expected);
