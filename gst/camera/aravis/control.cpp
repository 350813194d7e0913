/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "control.hpp"

#include <algorithm>
#include <cmath>

CameraFault
fault_of (const GError *error, CameraFault otherwise)
{
  if (error->domain != ARV_DEVICE_ERROR)
    return otherwise;
  switch (error->code) {
    case ARV_DEVICE_ERROR_TIMEOUT:
      return CameraFault::kTimedOut;
    case ARV_DEVICE_ERROR_NOT_CONNECTED:
      return CameraFault::kLost;
    case ARV_DEVICE_ERROR_NOT_FOUND:
      return CameraFault::kNotFound;
    case ARV_DEVICE_ERROR_NOT_CONTROLLER:
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED:
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_BUSY:
      return CameraFault::kBusy;
    default:
      return otherwise;
  }
}

std::string
joined (const std::vector<std::string> &words)
{
  std::string text;
  for (const std::string &word : words) {
    if (text.size () > 300)
      return text + ", ...";
    text += (text.empty () ? "" : ", ") + word;
  }
  return text;
}

std::string
number_text (double value)
{
  gchar text[G_ASCII_DTOSTR_BUF_SIZE];
  return g_ascii_formatd (text, sizeof text, "%.9g", value);
}

CameraControl::CameraControl (ArvCamera *camera, std::string label)
    : camera_ (camera), label_ (std::move (label))
{
}

CameraControl::~CameraControl ()
{
  g_object_unref (camera_);
}

CameraStatus
CameraControl::status (const std::string &what, GError *error, CameraFault otherwise) const
{
  if (!error)
    return {};
  const CameraFault fault = fault_of (error, otherwise);
  std::string text = what + ": " + error->message;
  g_error_free (error);
  if (fault == CameraFault::kTimedOut)
    text += " (it does not answer: is it still plugged in and powered?)";
  return refuse (fault, text);
}

bool
CameraControl::has (const char *feature) const
{
  const auto guard = lock ();
  return arv_device_is_feature_available (device (), feature, nullptr);
}

std::vector<std::string>
CameraControl::entries (const char *feature) const
{
  const auto guard = lock ();
  if (!ARV_IS_GC_ENUMERATION (arv_device_get_feature (device (), feature)))
    return {};
  guint count = 0;
  const char **names = arv_device_dup_available_enumeration_feature_values_as_strings (
      device (), feature, &count, nullptr);
  std::vector<std::string> words (names, names + (names ? count : 0));
  g_free (names);
  std::sort (words.begin (), words.end ()); /* Aravis gives them in the order of a hash table */
  return words;
}

bool
CameraControl::has_entry (const char *feature, const std::string &entry) const
{
  const std::vector<std::string> all = entries (feature);
  return std::find (all.begin (), all.end (), entry) != all.end ();
}

CameraStatus
CameraControl::writable (const std::string &feature, ArvGcNode *&node) const
{
  node = arv_device_get_feature (device (), feature.c_str ());
  if (!ARV_IS_GC_FEATURE_NODE (node) || ARV_IS_GC_CATEGORY (node))
    return refuse (CameraFault::kBadSetting, "the camera has no feature '" + feature + "'");
  if (!arv_device_is_feature_available (device (), feature.c_str (), nullptr))
    return refuse (CameraFault::kBadSetting, "feature '" + feature +
                                                 "' is not available as the camera is set now; "
                                                 "another feature before it may change that");
  if (arv_device_get_feature_access_mode (device (), feature.c_str ()) == ARV_GC_ACCESS_MODE_RO)
    return refuse (CameraFault::kBadSetting, "feature '" + feature + "' can only be read");
  return {};
}

CameraStatus
CameraControl::execute (const std::string &feature)
{
  const auto guard = lock ();
  ArvGcNode *node = nullptr;
  CameraStatus found = writable (feature, node);
  if (!found.ok ())
    return found;
  if (!ARV_IS_GC_COMMAND (node))
    return refuse (CameraFault::kBadSetting,
        "feature '" + feature + "' is not a command; give it a value: " + feature + "=...");
  GError *error = nullptr;
  arv_device_execute_command (device (), feature.c_str (), &error);
  return status ("command " + feature, error);
}

CameraStatus
CameraControl::assign (const std::string &feature, const std::string &value)
{
  const auto guard = lock ();
  ArvGcNode *node = nullptr;
  CameraStatus found = writable (feature, node);
  if (!found.ok ())
    return found;
  if (ARV_IS_GC_ENUMERATION (node)) /* before the others: it is an integer and a string, too */
    return assign_enumeration (feature, value);
  if (ARV_IS_GC_BOOLEAN (node))
    return assign_boolean (feature, value);
  if (ARV_IS_GC_COMMAND (node))
    return refuse (CameraFault::kBadSetting,
        "feature '" + feature + "' is a command and takes no value: write only its name");
  if (ARV_IS_GC_FLOAT (node))
    return assign_float (feature, value);
  if (ARV_IS_GC_INTEGER (node))
    return assign_integer (feature, value);
  if (ARV_IS_GC_STRING (node)) {
    GError *error = nullptr;
    arv_device_set_string_feature_value (device (), feature.c_str (), value.c_str (), &error);
    return status ("feature " + feature + "=" + value, error);
  }
  return refuse (CameraFault::kBadSetting, "feature '" + feature + "' has no value to set");
}

CameraStatus
CameraControl::assign_all (
    std::initializer_list<std::pair<const char *, std::string>> features_and_values)
{
  CameraStatus status;
  for (const auto &[feature, value] : features_and_values)
    if (status.ok ())
      status = assign (feature, value);
  return status;
}

CameraStatus
CameraControl::assign_if_there (
    std::initializer_list<const char *> features, const std::string &value)
{
  for (const char *feature : features)
    if (has (feature))
      return assign (feature, value);
  return {};
}

CameraStatus
CameraControl::assign_enumeration (const std::string &feature, const std::string &value)
{
  if (!has_entry (feature.c_str (), value))
    return refuse (CameraFault::kBadSetting, "feature " + feature + "=" + value +
                                                 ": the camera accepts " +
                                                 joined (entries (feature.c_str ())));
  GError *error = nullptr;
  arv_device_set_string_feature_value (device (), feature.c_str (), value.c_str (), &error);
  return status ("feature " + feature + "=" + value, error);
}

CameraStatus
CameraControl::assign_boolean (const std::string &feature, const std::string &value)
{
  gboolean on = FALSE;
  const std::string low = [&] {
    std::string text = value;
    for (char &c : text)
      c = g_ascii_tolower (c);
    return text;
  }();
  if (low == "true" || low == "1" || low == "on" || low == "yes")
    on = TRUE;
  else if (low != "false" && low != "0" && low != "off" && low != "no")
    return refuse (CameraFault::kBadSetting,
        "feature " + feature + "=" + value + ": the camera accepts true and false");
  GError *error = nullptr;
  arv_device_set_boolean_feature_value (device (), feature.c_str (), on, &error);
  return status ("feature " + feature + "=" + value, error);
}

CameraStatus
CameraControl::assign_integer (const std::string &feature, const std::string &value)
{
  gchar *end = nullptr;
  errno = 0;
  const std::int64_t number = g_ascii_strtoll (value.c_str (), &end, 0);
  const std::string what = "feature " + feature + "=" + value;
  if (value.empty () || *end || errno)
    return refuse (CameraFault::kBadSetting, what + ": expected an integer, as 10 or 0x0a");
  gint64 low = G_MININT64, high = G_MAXINT64, step = 1;
  GError *error = nullptr;
  arv_device_get_integer_feature_bounds (device (), feature.c_str (), &low, &high, &error);
  if (error) {
    low = G_MININT64;
    high = G_MAXINT64;
  }
  g_clear_error (&error);
  step = arv_device_get_integer_feature_increment (device (), feature.c_str (), nullptr);
  step = std::max<gint64> (step, 1);
  const guint64 above = guint64 (number) - guint64 (low); /* wraps only where it is below anyway */
  if (number < low || number > high || (step > 1 && above % guint64 (step) != 0))
    return refuse (CameraFault::kBadSetting,
        what + ": the camera accepts " + std::to_string (low) + " to " + std::to_string (high) +
            (step > 1 ? " in steps of " + std::to_string (step) : ""));
  arv_device_set_integer_feature_value (device (), feature.c_str (), number, &error);
  return status (what, error);
}

CameraStatus
CameraControl::assign_float (const std::string &feature, const std::string &value)
{
  gchar *end = nullptr;
  const double number = g_ascii_strtod (value.c_str (), &end);
  const std::string what = "feature " + feature + "=" + value;
  if (value.empty () || *end || !std::isfinite (number))
    return refuse (CameraFault::kBadSetting, what + ": expected a number, as 2.5");
  double low = -G_MAXDOUBLE, high = G_MAXDOUBLE;
  GError *error = nullptr;
  arv_device_get_float_feature_bounds (device (), feature.c_str (), &low, &high, &error);
  const bool bounded = !error && low <= high;
  g_clear_error (&error);
  if (bounded && (number < low || number > high))
    return refuse (CameraFault::kBadSetting,
        what + ": the camera accepts " + number_text (low) + " to " + number_text (high));
  arv_device_set_float_feature_value (device (), feature.c_str (), number, &error);
  return status (what, error);
}

bool
CameraControl::read (const char *feature, double &value) const
{
  const auto guard = lock ();
  ArvGcNode *node = arv_device_get_feature (device (), feature);
  GError *error = nullptr;
  double got = 0;
  if (ARV_IS_GC_FLOAT (node))
    got = arv_device_get_float_feature_value (device (), feature, &error);
  else if (ARV_IS_GC_INTEGER (node))
    got = arv_device_get_integer_feature_value (device (), feature, &error);
  else
    return false;
  const bool fine = !error && std::isfinite (got);
  g_clear_error (&error);
  if (fine)
    value = got;
  return fine;
}

bool
CameraControl::read (const char *feature, std::int64_t &value) const
{
  const auto guard = lock ();
  if (!ARV_IS_GC_INTEGER (arv_device_get_feature (device (), feature)))
    return false;
  GError *error = nullptr;
  const gint64 got = arv_device_get_integer_feature_value (device (), feature, &error);
  const bool fine = !error;
  g_clear_error (&error);
  if (fine)
    value = got;
  return fine;
}

bool
CameraControl::read (const char *feature, std::string &value) const
{
  const auto guard = lock ();
  if (!ARV_IS_GC_STRING (arv_device_get_feature (device (), feature)))
    return false;
  GError *error = nullptr;
  const char *got = arv_device_get_string_feature_value (device (), feature, &error);
  const bool fine = !error && got;
  g_clear_error (&error);
  if (fine)
    value = got;
  return fine;
}
