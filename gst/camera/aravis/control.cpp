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
  /* else cameras round or ignore values without a word */
  arv_camera_set_range_check_policy (camera_, ARV_RANGE_CHECK_POLICY_ENABLE);
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

/* Aravis takes what follows a number, or stands in its place, for nothing. */
static bool
is_number (ArvGcNode *node, const std::string &text)
{
  gchar *end = nullptr;
  if (ARV_IS_GC_FLOAT (node))
    return std::isfinite (g_ascii_strtod (text.c_str (), &end)) && !text.empty () && !*end;
  (void)g_ascii_strtoll (text.c_str (), &end, 0);
  return !text.empty () && !*end;
}

CameraStatus
CameraControl::assign (const std::string &feature, const std::string &value)
{
  const auto guard = lock ();
  const auto bad = CameraFault::kBadSetting;
  const std::string what = "feature " + feature + "=" + value;
  ArvGcNode *node = arv_device_get_feature (device (), feature.c_str ());
  if (!ARV_IS_GC_FEATURE_NODE (node) || ARV_IS_GC_CATEGORY (node))
    return refuse (bad, "the camera has no feature '" + feature + "'");
  if (ARV_IS_GC_COMMAND (node))
    return refuse (bad, what + ": it is a command and takes no value");
  if (ARV_IS_GC_ENUMERATION (node)) { /* before the others: it is an integer, too */
    const std::vector<std::string> all = entries (feature.c_str ());
    if (std::ranges::find (all, value) == all.end ())
      return refuse (bad, what + ": the camera accepts " + joined (all));
  } else if ((ARV_IS_GC_FLOAT (node) || ARV_IS_GC_INTEGER (node)) && !is_number (node, value)) {
    return refuse (bad, what + ": it takes a number");
  }
  GError *error = nullptr;
  arv_gc_feature_node_set_value_from_string (ARV_GC_FEATURE_NODE (node), value.c_str (), &error);
  return status (what, error);
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
CameraControl::assign_if_there (const char *feature, const std::string &value)
{
  return has (feature) ? assign (feature, value) : CameraStatus ();
}

CameraStatus
CameraControl::execute (const std::string &feature)
{
  const auto guard = lock ();
  if (!ARV_IS_GC_COMMAND (arv_device_get_feature (device (), feature.c_str ())))
    return refuse (CameraFault::kBadSetting,
        "features: the camera has no command '" + feature + "' (a value is set by NAME=VALUE)");
  GError *error = nullptr;
  arv_device_execute_command (device (), feature.c_str (), &error);
  return status ("command " + feature, error);
}

CameraStatus
CameraControl::assign_features (const std::string &features)
{
  gchar **words = nullptr;
  GError *error = nullptr;
  g_shell_parse_argv (features.c_str (), nullptr, &words, &error);
  if (g_error_matches (error, G_SHELL_ERROR, G_SHELL_ERROR_EMPTY_STRING))
    g_clear_error (&error);
  CameraStatus status = this->status ("features \"" + features + "\"", error);
  for (gchar **word = words; word && *word && status.ok (); word++) {
    const std::string text = *word;
    const std::size_t equals = text.find ('=');
    status = equals == std::string::npos
                 ? execute (text)
                 : assign (text.substr (0, equals), text.substr (equals + 1));
  }
  g_strfreev (words);
  return status;
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
