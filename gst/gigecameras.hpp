/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "foundcamera.hpp"

namespace rangecast {

/** Asks all networks for their GigE Vision cameras, by Aravis' discovery. Waits about a second for
 *  answers. Any thread; calls of several threads follow one another. */
FoundCameras find_gige_cameras ();

} // namespace rangecast
