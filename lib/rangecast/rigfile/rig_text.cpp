/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rig_text.hpp"

#include <charconv>
#include <climits>
#include <cmath>
#include <cstdio>

namespace rangecast {
namespace {

/* Values of fields, as cv::FileStorage lays them out. */
class StorageWriter {
public:
  explicit StorageWriter (bool json) : json_ (json), text_ (json ? "{" : "%YAML:1.0\n---") {}

  void begin_map (const char *name) { begin (name, "{"); }
  void begin_list (const char *name) { begin (name, "["); }
  void end_map () { end ("}"); }
  void end_list ()
  {
    if (empty_ && !json_)
      begin_line () += "[]";
    end ("]");
  }

  void add (const char *name, const std::string &value) { begin_value (name) += quoted (value); }
  void add (const char *name, int value) { begin_value (name) += std::to_string (value); }
  void add (const char *name, double value) { begin_value (name) += digits (value); }
  void add (const char *name, std::span<const double> values)
  {
    constexpr std::size_t kMargin = 71, kIndent = 4; /* where a line is too long */
    begin_value (name) += '[';
    bool first = true;
    for (double value : values) {
      if (!first)
        text_ += ',';
      first = false;
      const std::string item = digits (value);
      if (text_.size () - line_ + item.size () > kMargin)
        begin_line ().append (kIndent, ' ');
      else
        text_ += ' ';
      text_ += item;
    }
    text_ += " ]";
  }

  [[nodiscard]] std::string finish () { return text_ + (json_ ? "\n}\n" : "\n"); }

private:
  std::string &begin_line ()
  {
    text_ += '\n';
    line_ = text_.size ();
    return text_.append (json_ ? 4 * (depth_ + 1) : 3 * depth_, ' ');
  }

  /* @param name  "" for an item of a list */
  std::string &begin_value (const std::string &name, const char *space = " ")
  {
    if (json_ && !empty_)
      text_ += ',';
    empty_ = false;
    begin_line ();
    if (json_)
      return name.empty () ? text_ : text_ += '"' + name + "\": ";
    return text_ += name.empty () ? "-" : name + ':' + space;
  }

  void begin (const char *name, const char *bracket)
  {
    begin_value (name, "") += json_ ? bracket : "";
    empty_ = true;
    depth_++;
  }

  void end (const char *bracket)
  {
    depth_--;
    if (json_)
      begin_line () += bracket;
    empty_ = false;
  }

  [[nodiscard]] std::string digits (double value) const
  {
    constexpr int kDigits = 16; /* behind the point: all that a double has */
    char text[32];
    if (value >= INT_MIN && value <= INT_MAX && value == std::floor (value))
      return std::to_string (int (value)) + (json_ ? ".0" : ".");
    const auto end =
        std::to_chars (text, text + sizeof text, value, std::chars_format::scientific, kDigits);
    return {text, end.ptr};
  }

  /* In YAML, quotes only where they are needed. */
  [[nodiscard]] std::string quoted (const std::string &value) const
  {
    static constexpr std::string_view kPlain = "_ -()/+;", kNumber = "+-.0123456789",
                                      kEscaped = "\\'\"", kControl = "\n\r\t\b\f",
                                      kLetters = "nrtbf";
    const auto has = [] (std::string_view set, char c) {
      return set.find (c) != std::string_view::npos;
    };
    const auto is_alnum = [] (char c) {
      return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    };
    bool need_quotes = json_ || value.empty () || value[0] == ' ' || has (kNumber, value[0]);
    std::string text;
    for (char c : value) {
      need_quotes = need_quotes || !(is_alnum (c) || has (kPlain, c));
      if (has (kEscaped, c)) {
        text += {'\\', c};
      } else if (has (kControl, c)) {
        text += {'\\', kLetters[kControl.find (c)]};
      } else if (static_cast<unsigned char> (c) < ' ') {
        char code[8];
        std::snprintf (code, sizeof code, json_ ? "\\u%04x" : "\\x%02x", unsigned (c));
        text += code;
      } else {
        text += c;
      }
    }
    return need_quotes ? '"' + text + '"' : text;
  }

  const bool json_;
  std::string text_;
  std::size_t line_ = 0, depth_ = 0; /* where the line begins; lists and maps that are open */
  bool empty_ = true;                /* what was begun last has no value so far */
};

void
write_pose (StorageWriter &file, const char *name, const Pose &pose)
{
  const double t[] = {pose.translation.x, pose.translation.y, pose.translation.z};
  file.begin_map (name);
  file.add ("rotation", pose.rotation);
  file.add ("translation", t);
  file.end_map ();
}

void
write_lens (StorageWriter &file, const Intrinsics &k, const Distortion &distortion)
{
  const double values[] = {k.fx, k.fy, k.cx, k.cy};
  file.add ("intrinsics", values);
  if (!distortion.empty ())
    file.add ("distortion", distortion);
}

void
write_partner (StorageWriter &file, const char *name, const std::optional<PartnerCamera> &partner)
{
  if (!partner)
    return;
  file.begin_map (name);
  if (!partner->camera.empty ())
    file.add ("camera", partner->camera);
  write_lens (file, partner->intrinsics, partner->distortion);
  write_pose (file, "partner_from_left", partner->partner_from_left);
  file.end_map ();
}

void
write_view (StorageWriter &file, const View &view)
{
  const double size[] = {double (view.width), double (view.height)};
  file.begin_map ("");
  file.add ("id", view.id);
  if (!view.name.empty ())
    file.add ("name", view.name);
  if (!view.camera.empty ())
    file.add ("camera", view.camera);
  file.add ("image_size", size);
  write_lens (file, view.intrinsics, view.distortion);
  write_pose (file, "world_from_view", view.world_from_view);
  file.add ("depth_unit", view.depth_unit_m);
  file.add ("near", view.near_m);
  file.add ("far", view.far_m);
  write_partner (file, "right", view.right);
  write_partner (file, "third", view.third);
  file.end_map ();
}

} // namespace

std::string
rig_text (const Rig &rig, bool json)
{
  StorageWriter file (json);
  file.add ("rangecast_rig", kRigFileVersion);
  file.begin_list ("views");
  for (const View &view : rig.views)
    write_view (file, view);
  file.end_list ();
  return file.finish ();
}

} // namespace rangecast
