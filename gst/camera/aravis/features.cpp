/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "features.hpp"

#include <glib.h>

namespace {

class FeatureParser {
public:
  explicit FeatureParser (std::string_view text) : text_ (text) {}

  CameraStatus parse (std::vector<CameraFeature> &features)
  {
    for (skip_separators (); at_ < text_.size (); skip_separators ()) {
      CameraFeature feature;
      const CameraStatus status = parse_one (feature);
      if (!status.ok ())
        return status;
      features.push_back (std::move (feature));
    }
    return {};
  }

private:
  static bool separates (char c) { return g_ascii_isspace (c) || c == ',' || c == ';'; }
  [[nodiscard]] bool more () const { return at_ < text_.size (); }

  void skip_separators ()
  {
    while (more () && separates (text_[at_]))
      at_++;
  }

  CameraStatus parse_one (CameraFeature &feature)
  {
    const std::size_t begin = at_;
    while (more () && (g_ascii_isalnum (text_[at_]) || text_[at_] == '_'))
      at_++;
    feature.name = text_.substr (begin, at_ - begin);
    if (feature.name.empty () || g_ascii_isdigit (feature.name[0]))
      return fail (begin, "a feature's name (letters, digits, '_')");
    if (!more () || separates (text_[at_])) {
      feature.command = true;
      return {};
    }
    if (text_[at_] != '=')
      return fail (at_, "'=' and a value after '" + feature.name + "'");
    at_++;
    return parse_value (feature);
  }

  CameraStatus parse_value (CameraFeature &feature)
  {
    const std::size_t begin = at_;
    if (more () && (text_[at_] == '"' || text_[at_] == '\'')) {
      const std::size_t end = text_.find (text_[at_], at_ + 1);
      if (end == std::string_view::npos)
        return fail (begin, std::string ("a closing ") + text_[begin]);
      feature.value = text_.substr (begin + 1, end - begin - 1);
      at_ = end + 1;
      if (more () && !separates (text_[at_]))
        return fail (at_, "a space after the quoted value of '" + feature.name + "'");
      return {};
    }
    while (more () && !separates (text_[at_]) && text_[at_] != '=')
      at_++;
    if (more () && text_[at_] == '=')
      return fail (at_, "a space before the next feature");
    feature.value = text_.substr (begin, at_ - begin);
    if (feature.value.empty ())
      return fail (begin, "a value for '" + feature.name + "'");
    return {};
  }

  CameraStatus fail (std::size_t place, const std::string &expected) const
  {
    std::string rest (text_.substr (place, 20));
    gchar *shown = g_utf8_make_valid (rest.c_str (), -1);
    rest = rest.empty () ? "its end" : "'" + std::string (shown) + "'";
    g_free (shown);
    return {CameraFault::kBadSetting, "features: expected " + expected + " at " + rest};
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

} // namespace

CameraStatus
parse_camera_features (std::string_view text, std::vector<CameraFeature> &features)
{
  features.clear ();
  const CameraStatus status = FeatureParser (text).parse (features);
  if (!status.ok ())
    features.clear ();
  return status;
}
