/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>

#include <cstdint>
#include <string>

/** Registers and values of what our GenICam description has more than that of Aravis. */
inline constexpr std::uint32_t kTriggerByLine = 0, kTriggerBySoftware = 1, kTriggerByAction = 2,
                               kTriggerByLine1 = 3;
inline constexpr std::uint32_t kSingleFrame = 2;

/** Aravis' fake camera with action commands and its output line described.
 *  @return registers and description, owned */
ArvFakeCamera *make_fake_camera (const std::string &serial);
