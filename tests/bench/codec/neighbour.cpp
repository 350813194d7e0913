/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The neighbour code as the elements use it: one encoder and one decoder for all frame sets. */
#include <charconv>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <sstream>

#include "codec.hpp"

using namespace rangecast;

namespace bench {
namespace {

const char *const kProfileNames[] = {"plain", "packed", "entropy"};

/* Slices that no packet holds are a codec of their own: nobody should choose them for a network. */
std::string
name_of_profile (const EncoderSettings &settings)
{
  const bool is_long = settings.max_slice_size > EncoderSettings ().max_slice_size;
  return std::string (kProfileNames[static_cast<int> (settings.profile)]) +
         (settings.temporal ? ", temporal" : "") + (is_long ? ", long slices" : "");
}

class NeighbourCode final : public Codec {
public:
  explicit NeighbourCode (const EncoderSettings &settings)
      : Codec (name_of_profile (settings), settings_text (settings))
  {
  }

  Status configure (const Rig &rig, const EncoderSettings &settings)
  {
    if (Status s = encoder_.configure (rig, settings); !s.ok ())
      return s;
    return decoder_.set_rig (rig);
  }

  void begin () override { encoder_.request_key (); }

  Status encode (FrameSet &set) override
  {
    images_.clear ();
    for (ViewPictures &view : set)
      images_.push_back (view.person.image (view.view_id, view.roi));
    EncoderResult result;
    return encoder_.encode (images_, frame_number_++, 1, result);
  }

  void collect (Coded &to) const override { to.assign (1, encoder_.bytes ()); }

  Status decode (const Coded &from, std::vector<Picture> &pictures) override
  {
    DecoderResult result;
    decoder_.plan (from[0], result);
    if (decoder_.views ().size () != pictures.size ())
      return {StatusCode::kBadData, "some views are missing"};
    images_.clear ();
    for (std::size_t i = 0; i < pictures.size (); i++) {
      const auto &planned = decoder_.views ()[i];
      images_.push_back (pictures[i].image (planned.view_id, planned.roi));
    }
    if (Status s = decoder_.decode (images_, 1, result); !s.ok ())
      return s;
    if (result.bad_slices || result.missing_pixels || result.unknown_pixels)
      return {StatusCode::kBadData, "damaged slices"};
    return {};
  }

private:
  AccessUnitEncoder encoder_;
  AccessUnitDecoder decoder_;
  std::vector<RangeImage> images_;
  std::uint32_t frame_number_ = 0;
};

/* A property of neighbourcodeenc. @return what was expected */
std::string
set_property (const std::string &name, const std::string &value, EncoderSettings &settings)
{
  for (int i = 0; i < 3; i++)
    if (name == "profile" && value == kProfileNames[i]) {
      settings.profile = static_cast<Profile> (i);
      return {};
    }
  if (name == "profile")
    return "profile=plain, packed or entropy";
  if (name == "choice" && (value == "first" || value == "best")) {
    settings.choice = value == "best" ? NeighbourChoice::kBest : NeighbourChoice::kFirst;
    return {};
  }
  if (name == "choice")
    return "choice=first or best";
  if (name == "temporal" && (value == "true" || value == "false")) {
    settings.temporal = value == "true";
    return {};
  }
  if (name == "temporal")
    return "temporal=true or false";
  const std::pair<const char *, int *> numbers[] = {{"depth-bits", &settings.depth_bits},
      {"colour-bits", &settings.colour_bits}, {"depth-threshold", &settings.depth_threshold},
      {"colour-threshold", &settings.colour_threshold},
      {"max-slice-size", &settings.max_slice_size}};
  for (const auto &[property, to] : numbers) {
    const char *end = value.data () + value.size ();
    if (name == property)
      return std::from_chars (value.data (), end, *to).ptr == end && !value.empty ()
                 ? ""
                 : name + "=NUMBER";
  }
  return "properties of neighbourcodeenc, not '" + name + "'";
}

} // namespace

std::string
settings_text (const EncoderSettings &s)
{
  const EncoderSettings defaults;
  std::ostringstream text;
  text << "depth-bits=" << s.depth_bits << " depth-threshold=" << s.depth_threshold
       << " colour-threshold=" << s.colour_threshold;
  if (s.colour_bits != defaults.colour_bits)
    text << " colour-bits=" << s.colour_bits;
  if (s.choice != defaults.choice)
    text << " choice=best";
  if (s.temporal)
    text << " temporal=true";
  if (s.max_slice_size != defaults.max_slice_size)
    text << " max-slice-size=" << s.max_slice_size;
  return text.str ();
}

std::string
read_settings (const std::string &text, EncoderSettings &settings)
{
  std::istringstream words (text);
  std::string word;
  while (words >> word) {
    const std::size_t equals = word.find ('=');
    if (equals == std::string::npos)
      return "PROPERTY=VALUE, not '" + word + "'";
    if (const std::string expected =
            set_property (word.substr (0, equals), word.substr (equals + 1), settings);
        !expected.empty ())
      return expected;
  }
  const std::string wrong = validate (settings).message (); /* "encoder: WHAT, expected RANGE" */
  return wrong.empty () ? "" : "values in range: " + wrong.substr (wrong.find (": ") + 2);
}

Status
make_neighbour_code (const Rig &rig, const EncoderSettings &settings, std::unique_ptr<Codec> &codec)
{
  auto made = std::make_unique<NeighbourCode> (settings);
  if (Status s = made->configure (rig, settings); !s.ok ())
    return s;
  codec = std::move (made);
  return {};
}

} // namespace bench
