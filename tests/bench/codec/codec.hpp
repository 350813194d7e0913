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
  Codec (std::string name, std::string settings, bool whole)
      : name_ (std::move (name)), settings_ (std::move (settings)), whole_ (whole)
  {
  }
  virtual ~Codec () = default;
  Codec (const Codec &) = delete;
  Codec &operator= (const Codec &) = delete;

  [[nodiscard]] const std::string &name () const { return name_; }
  [[nodiscard]] const std::string &settings () const { return settings_; }
  /** Codes whole pictures, not only the ROI. */
  [[nodiscard]] bool whole () const { return whole_; }

  /** The next frame set to encode is the first one again: nothing may refer to earlier ones. */
  virtual void begin () {}
  /** Codes a frame set and keeps the bytes. Measured. */
  virtual rangecast::Status encode (FrameSet &set) = 0;
  /** Hands out the bytes of the last frame set. Not measured. */
  virtual void collect (Coded &to) const = 0;
  /** Decodes a frame set. Measured.
   *  @param pictures  one for each view in order, of the right size, to be filled */
  virtual rangecast::Status decode (const Coded &from, std::vector<Picture> &pictures) = 0;
  /** What decode() left to do before pictures can be compared. Not measured.
   *  @param set  the original, for what is not the codec's to know: which pixel a point was */
  virtual rangecast::Status finish (const FrameSet &set, std::vector<Picture> &pictures);

private:
  std::string name_, settings_;
  bool whole_;
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

/** @name Peers
 *  Nothing for a peer whose library was not there when this was built. @{ */
enum class DepthCode { kRvl, kRvlZstd, kPngFast, kPng };
enum class ColourCode { kJpeg, kPngFast, kPng };
/** Depth and colour each with a code of its own. @param quality  of JPEG, 1 to 100 */
std::unique_ptr<Codec> make_pair (DepthCode depth, ColourCode colour, int quality, bool whole);
/** A point cloud: sequential, positions of 11 bits in the box of the view's points, colour exact.
 */
std::unique_ptr<Codec> make_draco (const rangecast::Rig &rig);
/** Two video streams of each view: colour in 4:2:0, depth as hues in 4:4:4. x264, preset veryfast,
 *  tune zerolatency, a key frame every 30.
 *  @param colour_crf, depth_crf  constant rate factors, 0 (best) to 51 */
std::unique_ptr<Codec> make_x264 (const rangecast::Rig &rig, int colour_crf, int depth_crf);
/** @} */

inline constexpr const char *kPeerName = "RVL + JPEG"; ///< what all are compared with
/** The name of a codec that may code whole pictures. */
std::string name_of (const std::string &code, bool whole);

} // namespace bench
