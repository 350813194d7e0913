/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "status.hpp"

/** Reads and writes the features of one camera. Faults name the camera, the feature, the value and
 *  what the camera accepts. Any thread; the lock admits one at a time, since GenICam nodes have
 *  state. */
class CameraControl {
public:
  /** @param camera  transfer full
   *  @param label   how texts name it */
  CameraControl (ArvCamera *camera, std::string label);
  CameraControl (const CameraControl &) = delete;
  CameraControl &operator= (const CameraControl &) = delete;
  ~CameraControl ();

  [[nodiscard]] ArvCamera *camera () const { return camera_; }
  [[nodiscard]] ArvDevice *device () const { return arv_camera_get_device (camera_); }
  [[nodiscard]] const std::string &label () const { return label_; }
  /** For calls of Aravis that are not below. */
  [[nodiscard]] std::unique_lock<std::recursive_mutex> lock () const
  {
    return std::unique_lock (lock_);
  }

  [[nodiscard]] bool has (const char *feature) const;
  /** The entries that an enumeration accepts now; empty if the feature is no enumeration. */
  [[nodiscard]] std::vector<std::string> entries (const char *feature) const;
  [[nodiscard]] bool has_entry (const char *feature, const std::string &entry) const;

  /** @param value  text as in a features string, whatever the feature's type */
  CameraStatus assign (const std::string &feature, const std::string &value);
  /** One after the other, until one fails. */
  CameraStatus assign_all (
      std::initializer_list<std::pair<const char *, std::string>> features_and_values);
  CameraStatus execute (const std::string &feature);
  /** Sets the first of these features that the camera has; ok if it has none. */
  CameraStatus assign_if_there (
      std::initializer_list<const char *> features, const std::string &value);

  [[nodiscard]] bool read (const char *feature, double &value) const;
  [[nodiscard]] bool read (const char *feature, std::int64_t &value) const;
  [[nodiscard]] bool read (const char *feature, std::string &value) const;

  /** A status of this camera.
   *  @param what       what was tried, as "exposure of 300 us"
   *  @param error      transfer full; null: ok
   *  @param otherwise  the fault of an error that is not the device's */
  CameraStatus status (const std::string &what, GError *error,
      CameraFault otherwise = CameraFault::kBadSetting) const;
  CameraStatus refuse (CameraFault fault, const std::string &text) const
  {
    return {fault, label_ + ": " + text};
  }

private:
  CameraStatus assign_enumeration (const std::string &feature, const std::string &value);
  CameraStatus assign_integer (const std::string &feature, const std::string &value);
  CameraStatus assign_float (const std::string &feature, const std::string &value);
  CameraStatus assign_boolean (const std::string &feature, const std::string &value);
  CameraStatus writable (const std::string &feature, ArvGcNode *&node) const;

  ArvCamera *camera_;
  std::string label_;
  mutable std::recursive_mutex lock_;
};

/** The fault that corresponds to an error of Aravis. */
CameraFault fault_of (const GError *error, CameraFault otherwise);
/** "a, b, c"; cut after some 300 characters. */
std::string joined (const std::vector<std::string> &words);
/** A number with nine digits, in the C locale. */
std::string number_text (double value);
