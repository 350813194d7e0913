/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>
#include <string>

/** Text that came from a device, fit for messages and properties. */
inline std::string
valid_utf8 (const std::string &text)
{
  gchar *valid = g_utf8_make_valid (text.c_str (), gssize (text.size ()));
  std::string copy = valid;
  g_free (valid);
  return copy;
}

/** What went wrong with a camera, coarsely: enough for a caller to decide whether to try again. */
enum class CameraFault {
  kNone,
  kNotFound,     ///< no camera of that name answers (RESOURCE/NOT_FOUND); trying again may help
  kBusy,         ///< another program has control of it (RESOURCE/BUSY); trying again may help
  kNoPermission, ///< the system refuses the device or the port (RESOURCE/NOT_AUTHORIZED)
  kTimedOut,     ///< it was found but does not answer (RESOURCE/READ); trying again may help
  kLost,         ///< it was open and is gone (RESOURCE/READ); only a new open() helps
  kBadSetting,   ///< the camera has no such feature or refuses the value (RESOURCE/SETTINGS)
  kUnsupported,  ///< a pixel format or payload that cannot be carried (STREAM/FORMAT)
  kFailed,       ///< anything else (RESOURCE/FAILED)
};

/** What is said of a camera that was open and is gone, however that was noticed.
 *  @param label  how texts name it */
inline std::string
lost_text (const std::string &label)
{
  return label + ": does not answer any more; expected it plugged in and powered, and no other "
                 "program to take control of it";
}

/** The result of a camera function: fine, or a fault and one sentence that names the camera and
 * what was expected. The words in brackets above are the GStreamer errors that fit. */
class [[nodiscard]] CameraStatus {
public:
  CameraStatus () = default;
  CameraStatus (CameraFault fault, const std::string &message)
      : fault_ (fault), message_ (valid_utf8 (message))
  {
  }

  [[nodiscard]] bool ok () const { return fault_ == CameraFault::kNone; }
  [[nodiscard]] CameraFault fault () const { return fault_; }
  [[nodiscard]] const std::string &message () const { return message_; }
  /** Whether the same call may work later, without the user changing any setting. */
  [[nodiscard]] bool may_recover () const
  {
    return fault_ == CameraFault::kNotFound || fault_ == CameraFault::kBusy ||
           fault_ == CameraFault::kTimedOut || fault_ == CameraFault::kLost;
  }

private:
  CameraFault fault_ = CameraFault::kNone;
  std::string message_;
};
