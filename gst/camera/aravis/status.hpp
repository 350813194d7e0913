/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>
#include <string>

/** Text of a device as valid UTF-8, for messages and properties. */
inline std::string
valid_utf8 (const std::string &text)
{
  gchar *valid = g_utf8_make_valid (text.c_str (), gssize (text.size ()));
  std::string copy = valid;
  g_free (valid);
  return copy;
}

inline std::string
valid_utf8 (const char *text)
{
  return text ? valid_utf8 (std::string (text)) : "";
}

/** What went wrong with a camera, for callers to decide whether to try again. The words in brackets
 *  are the GStreamer errors that fit. */
enum class CameraFault {
  kNone,
  kNotFound,     ///< no camera of that name answers (RESOURCE/NOT_FOUND); trying again may help
  kBusy,         ///< another program has control of it (RESOURCE/BUSY); trying again may help
  kNoPermission, ///< the system refuses the device or the port (RESOURCE/NOT_AUTHORIZED)
  kTimedOut,     ///< it was found but does not answer (RESOURCE/READ); trying again may help
  kLost,         ///< it was open and is gone (RESOURCE/READ); only a new open() helps
  kBadSetting,   ///< the camera has no such feature or refuses the value (RESOURCE/SETTINGS)
  kUnsupported,  ///< an unsupported pixel format or payload (STREAM/FORMAT)
  kFailed,       ///< anything else (RESOURCE/FAILED)
};

/** The text of kLost. @param label  Camera::label() */
inline std::string
lost_text (const std::string &label)
{
  return label +
         ": the camera no longer responds; check power and cable, and that no other program "
         "controls it";
}

/** The result of a camera function: ok, or a fault and one sentence that names the camera and what
 *  was expected. */
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
