/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What codec_bench measures: everything that turns frame sets into bytes and back. */
#pragma once

#include <cstdint>
#include <memory>
#include <rangecast/base/status.hpp>
#include <rangecast/neighbourcode/encoder.hpp>
#include <string>
#include <utility>
#include <vector>

#include "input.hpp"

namespace bench {

/** A coded frame set, in as many pieces as its codec likes. Keeps its memory. */
using Coded = std::vector<std::vector<std::uint8_t>>;

/** One codec with one setting. Frame sets come in order of time, to the encoder and to the decoder,
 *  all of them again and again; a codec may refer to earlier ones. One thread each. */
class Codec {
public:
  Codec (std::string name, std::string settings)
      : name_ (std::move (name)), settings_ (std::move (settings))
  {
  }
  virtual ~Codec () = default;
  Codec (const Codec &) = delete;
  Codec &operator= (const Codec &) = delete;

  [[nodiscard]] const std::string &name () const { return name_; }
  [[nodiscard]] const std::string &settings () const { return settings_; }

  /** The next frame set to encode is the first one again: nothing may refer to earlier ones. */
  virtual void begin () {}
  /** Codes a frame set and keeps the bytes. Measured. */
  virtual rangecast::Status encode (FrameSet &set) = 0;
  /** Hands out the bytes of the last frame set. Not measured. */
  virtual void collect (Coded &to) const = 0;
  /** Decodes a frame set. Measured.
   *  @param pictures  one for each view in order, of the right size, to be filled */
  virtual rangecast::Status decode (const Coded &from, std::vector<Picture> &pictures) = 0;

private:
  std::string name_, settings_;
};

using Codecs = std::vector<std::unique_ptr<Codec>>;

/** A codec's own settings as launch strings have them; colour bits, choice and slice size only if
 *  they are not the default. */
std::string settings_text (const rangecast::EncoderSettings &settings);
/** Reads "profile=packed depth-bits=10 ...", the properties of neighbourcodeenc; what is not named
 *  keeps its default. @return what was expected, empty if all is well */
std::string read_settings (const std::string &text, rangecast::EncoderSettings &settings);

/** @return kBadValue for settings out of range */
rangecast::Status make_neighbour_code (const rangecast::Rig &rig,
    const rangecast::EncoderSettings &settings, std::unique_ptr<Codec> &codec);

/** The peer: RVL for depth and JPEG for colour. @param quality  of JPEG, 1 to 100 */
std::unique_ptr<Codec> make_peer (int quality);

inline constexpr const char *kPeerName = "RVL + JPEG"; ///< what all are compared with

/** RVL + JPEG at all qualities. */
void add_peers (Codecs &codecs);

/** The neighbour code: every profile at several thresholds and choices.
 *  @param sequence  there are several frame sets, so that temporal ones make sense */
rangecast::Status add_profiles (const rangecast::Rig &rig, bool sequence, Codecs &codecs);

} // namespace bench
