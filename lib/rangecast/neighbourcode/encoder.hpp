/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/quantiser.hpp"
#include "../geometry/range_image.hpp"
#include "bitstream/slice_partition.hpp"
#include "bitstream/unit.hpp"
#include "compact/encoder.hpp"
#include "plain/encoder.hpp"
#include "plain/temporal.hpp"
#include "reference_choice.hpp"

namespace rangecast {

/** Which of the neighbours that are near enough replaces a pixel, if any. */
enum class NeighbourChoice : std::uint8_t {
  kFirst, ///< the first: left, upper-left, upper, upper-right
  kBest,  ///< what costs least in error and bits, in full too; profiles packed and entropy
};

struct EncoderSettings {
  int depth_bits = 12;       ///< 6 to 16
  int colour_bits = 8;       ///< 4 to 8
  int depth_threshold = 8;   ///< codes; 0 to 65535
  int colour_threshold = 5;  ///< codes of each of R, G, B; 0 to 255
  int max_slice_size = 1200; ///< bytes with all headers; 256 to 65535
  Profile profile = Profile::kPlain;
  NeighbourChoice choice = NeighbourChoice::kFirst;
  DepthScale depth_scale = DepthScale::kLinear;
  /** A pixel may equal the same one of the frame set before, too. */
  bool temporal = false;
  /** Within this time every pixel is coded without reference to earlier frame sets; 0: only in key
   * frame sets. */
  std::uint64_t refresh_period_ns = 1'000'000'000;
  /** Of frame sets whose capture times do not grow. */
  std::uint64_t frame_interval_ns = 1'000'000'000 / 30;

  friend bool operator== (const EncoderSettings &, const EncoderSettings &) = default;
};

Status validate (const EncoderSettings &settings);

/** Codes pieces of any view. Nothing of one piece has an effect on the next. */
struct PieceEncoder {
  PlainEncoder plain;
  PlainTemporalEncoder plain_temporal;
  CompactEncoder compact; ///< profiles packed and entropy
};

/** Codes range images of one view, in pieces that do not depend on one another: in whatever order
 *  and with whatever helper they are coded, their bytes are the same. Keeps its memory. */
class ViewEncoder {
public:
  /** Sets up for a view. Builds tables only if something changed. */
  Status configure (const View &view, const EncoderSettings &settings);
  /** Changes nothing but the thresholds: at no cost. They must be within their ranges. */
  void set_thresholds (int depth, int colour)
  {
    settings_.depth_threshold = depth;
    settings_.colour_threshold = colour;
  }

  /** Begins a range image: finds into which pieces it is cut.
   *
   *  Pixels are scanned row by row. A valid one is compared with its left, upper-left, upper and
   *  upper-right neighbours, as they are after quantisation and replacement; the first that is near
   *  enough in depth and in each of R, G, B replaces it. Neighbours outside the slice do not exist.
   *  An empty ROI gives one slice without pixels. Depths outside near..far are invalid.
   *  @param image  must live until all pieces are coded
   *  @return kBadSize if the ROI does not lie in the view's image */
  Status begin (const ConstRangeImage &image, std::uint32_t frame_number);

  struct PieceId {
    std::size_t band, piece;
  };
  /** Calls take (id) for each piece that is to be coded. */
  template <typename Take> void for_open_pieces (const Take &take) const
  {
    for (std::size_t b = 0; b < band_count_; b++)
      for (std::size_t p = 0; bands_[b].is_open && p < bands_[b].count; p++)
        take (PieceId{b, p});
  }
  /** Codes a piece. Different ones may be coded at the same time. */
  void code (PieceId id, PieceEncoder &with);
  /** To be called when all open pieces have been coded. @return false if some bands had to be cut
   * into more pieces, or are to be coded another way: these are open now */
  bool finish ();

  /** What the range image came to. */
  [[nodiscard]] EncoderResult result () const;
  /** Calls take (bytes) for each piece, in order; valid until the next begin(). */
  template <typename Take> void for_coded_pieces (const Take &take) const
  {
    for (std::size_t b = 0; b < band_count_; b++)
      for (std::size_t p = 0; p < bands_[b].count; p++)
        take (std::span<const std::uint8_t> (bands_[b].pieces[p].bytes));
  }

  /** The next range image is coded without reference to earlier ones. */
  void request_key () { references_.forget (); }

  [[nodiscard]] const DepthQuantiser &depth () const { return depth_; }

private:
  struct Piece {
    int first_column = 0, columns = 0; /* of the ROI */
    std::vector<std::uint8_t> bytes;
    EncoderResult result;
  };
  /* Whether a band is coded with a reference and without one, to see which is smaller. What is
   * coded last is what later frame sets refer to, so the way that is expected to be comes second,
   * and the other one once more if it has been. */
  enum class Trial : std::uint8_t { kNone, kFirst, kSecond, kAgain };
  struct Plan { /* of a band */
    RowBand rows;
    bool fine = false; /* pixels are finer than need be, for later frame sets to take them */
    Trial trial = Trial::kNone;
  };
  struct Band {
    Plan plan;
    std::size_t first_bytes = 0; /* of a trial */
    std::vector<Piece> pieces;   /* those behind the first `count` are memory for later */
    std::size_t count = 0;
    bool is_open = false;
    bool misfits = false; /* a row of a piece is longer than a slice may be */
  };
  void fill_header (const ConstRangeImage &image, std::uint32_t frame_number);
  void make_empty_slice ();
  void plan_references ();
  void cut_bands ();
  void cut (Band &band, int pieces);
  void make_room (Band &band, int pieces);
  [[nodiscard]] int pieces_of (const Plan &plan) const;
  [[nodiscard]] CompactSettings compact_settings (bool fine) const;
  [[nodiscard]] std::size_t pixels_of (const Band &band) const;
  static std::size_t bytes_of (const Band &band);
  bool go_on (Band &band);
  bool code_compact (
      const Band &band, const SliceHeader &header, Piece &piece, CompactEncoder &with);
  void note_bytes ();

  View view_;
  EncoderSettings settings_;
  bool configured_ = false;
  DepthQuantiser depth_;
  ColourQuantiser colour_;
  PlainCodes plain_codes_;
  ReferencePair references_;
  RefreshSchedule refresh_;
  ReferenceChoice reference_choice_;
  MotionMemory motions_;
  double delta_bytes_per_pixel_ = 0; /* of the last bands with a reference; 0: there was none */

  /* Of the range image that was begun last. */
  ConstRangeImage image_;
  SliceHeader header_;
  CodingReference reference_;
  std::vector<RowBand> rows_, fine_, coarse_, both_; /* what refresh asks for, and sorted */
  std::vector<Plan> plans_;                          /* from top to bottom */
  std::vector<Band> bands_; /* those behind the first band_count_ are memory for later */
  std::size_t band_count_ = 0;
};

} // namespace rangecast
