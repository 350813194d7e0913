/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "types.hpp"

/** Reads and writes the features of one camera. Faults name the camera, the feature and the value.
 *  Any thread; the lock admits one at a time, since GenICam nodes have state. */
class CameraControl {
public:
  /** @param camera  transfer full
   *  @param label   how texts name it */
  CameraControl (ArvCamera *camera, std::string label);
  CameraControl (const CameraControl &) = delete;
  CameraControl &operator= (const CameraControl &) = delete;
  ~CameraControl () { g_object_unref (camera_); }

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

  /** @param value  text as in a features string, whatever the feature's type */
  CameraStatus assign (const std::string &feature, const std::string &value);
  /** One after the other, until one fails. */
  CameraStatus assign_all (
      std::initializer_list<std::pair<const char *, std::string>> features_and_values);
  /** Does nothing if the camera does not have the feature. */
  CameraStatus assign_if_there (const char *feature, const std::string &value);
  CameraStatus execute (const std::string &feature);
  /** @param features  "Name=Value Command ...", quoted as in a shell */
  CameraStatus assign_features (const std::string &features);

  [[nodiscard]] bool read (const char *feature, double &value) const;

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
