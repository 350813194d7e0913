/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a RangecastDecoder is, for this folder and the module of the browser. */
#pragma once

#include <array>
#include <cstdint>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/surface/strips.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rangecast.h"

namespace rangecast {

#ifdef __wasm__ /* with 512 MiB of memory; a pixel takes about 80 bytes with its vertices */
inline constexpr std::size_t kMaxDecoderViews = 16;
inline constexpr int kMaxDecoderSide = 8192;                               /* kMaxStripSide */
inline constexpr std::uint64_t kMaxDecoderPixels = std::uint64_t{1} << 22; /* of a frame set */
#else
inline constexpr std::size_t kMaxDecoderViews = kMaxViews;
inline constexpr int kMaxDecoderSide = kMaxImageSide;
inline constexpr std::uint64_t kMaxDecoderPixels = std::uint64_t{kMaxRigPixels};
#endif

} // namespace rangecast

/** See rangecast.h. */
struct RangecastDecoder {
public:
  using Bytes = std::span<const std::uint8_t>;

  explicit RangecastDecoder (int threads) : threads_ (threads) {}

  void push_units (Bytes units);
  RangecastResult push_bytes (Bytes bytes);
  RangecastResult open (std::uint64_t size, RangecastRead read, void *user_data);
  void discontinuity () { decoder_.reset_references (); }
  void reset ();
  RangecastResult next () { return has_stream_ ? next_of_stream () : decode (RANGECAST_NO_TIME); }
  RangecastResult seek (std::uint64_t time);

  /** Keeps a sentence. @return the result */
  RangecastResult fail (std::string_view message, RangecastResult result = RANGECAST_ERROR);
  /** Also the units that were pushed for the next one. */
  void drop_frame_set ();
  [[nodiscard]] const std::string &message () const { return message_; }

  /** nullptr: none was complete, or it is too large. */
  [[nodiscard]] const rangecast::Rig *rig () const { return has_rig_ ? &decoder_.rig () : nullptr; }
  /** Changes with the rig. */
  [[nodiscard]] unsigned rig_number () const { return rig_number_; }
  /** Of the last frame set. */
  [[nodiscard]] std::span<const rangecast::RangeImage> images () const { return images_; }
  [[nodiscard]] const RangecastFrameSet &frame_set () const { return frame_set_; }
  [[nodiscard]] RangecastStream stream () const;
  /** Blend planes of the last frame set, one for each image. */
  std::span<const rangecast::BlendPlanes> planes ();

private:
  struct Planes {
    std::vector<std::uint16_t> depth;
    std::vector<rangecast::Rgbx> colour;
  };
  /* A byte stream: what was pushed, or what read_ reads. */
  struct Stream {
    RangecastRead read = nullptr;
    void *user_data = nullptr;
    std::uint64_t size = UINT64_MAX; /* bytes; of pushed ones known at the end */
    std::uint64_t at = 0;            /* offset of what `buffer` holds from `begin` on */
    std::vector<std::uint8_t> buffer;
    std::size_t begin = 0, garbage = 0, wanted = 0; /* as next_part() says */
    bool any_access_unit = false, any_frame_set = false;
    std::uint64_t first_ns = rangecast::kNoTime, last_ns = rangecast::kNoTime;
    std::string ending;  /* how it is cut off; empty: it is not */
    std::string version; /* why its beginning cannot be read */

    [[nodiscard]] Bytes bytes () const { return Bytes (buffer).subspan (begin); }
    [[nodiscard]] std::uint64_t end () const { return at + bytes ().size (); }
    void skip (std::size_t n);
    bool fill (std::size_t wanted);
    [[nodiscard]] rangecast::StreamFile file () const;
  };

  void add_units (Bytes units);
  bool use_rig ();
  bool make_images ();
  RangecastResult decode (std::uint64_t time);
  RangecastResult decode_part (const rangecast::StreamPart &part);
  RangecastResult next_of_stream ();
  [[nodiscard]] std::string missing_data () const;

  int threads_;
  std::string message_;
  std::array<Planes, rangecast::kMaxDecoderViews> memory_; /* of images_ */
  std::vector<rangecast::BlendPlanes> planes_;
  std::uint64_t planes_of_ = 0; /* number of the frame set */
  unsigned rig_number_ = 0;     /* goes on counting, as that of frame_set_, after reset() */

  rangecast::RigCollector collector_;
  unsigned used_generation_ = 0;
  bool has_rig_ = false;
  std::string refusal_; /* why the rig or the last unit cannot be used */
  rangecast::AccessUnitDecoder decoder_;
  std::vector<std::uint8_t> pending_; /* units of the next frame set */
  std::vector<rangecast::RangeImage> images_;
  RangecastFrameSet frame_set_{};
  bool has_stream_ = false;
  Stream stream_;
};
