/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "strips.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace rangecast {
namespace {

bool
same_colour (Rgbx a, Rgbx b)
{
  return a.r == b.r && a.g == b.g && a.b == b.b;
}

class Builder {
public:
  Builder (const ConstRangeImage &image, const StripSettings &settings,
      std::vector<StripVertex> &to, StripResult &result)
      : image_ (image), settings_ (settings), to_ (to), result_ (result),
        width_ (std::min (image.depth.width, kMaxStripSide)),
        height_ (std::min (image.depth.height, kMaxStripSide)),
        step_ (static_cast<int> (settings.depth_step * 65536))
  {
  }

  void build ()
  {
    for (int y = 0; y < height_; y++) {
      depth_ = image_.depth.row (y);
      below_ = y + 1 < height_ ? image_.depth.row (y + 1) : nullptr;
      row_ = y;
      if (settings_.mode == StripMode::kStrips) {
        std::swap (met_, meets_);
        std::fill_n (meets_, width_, false);
        bands_of_row ();
      } else
        pixels_of_row ();
    }
  }

private:
  [[nodiscard]] bool near (int a, int b) const
  {
    return static_cast<std::int64_t> (std::abs (a - b)) * 65536 <=
           static_cast<std::int64_t> (std::min (a, b)) * step_;
  }

  [[nodiscard]] bool joins_below (int x) const
  {
    return below_ && below_[x] != kInvalidDepth && near (depth_[x], below_[x]);
  }

  /* Where the lower vertex of a pixel is: kCentre of the one below, or below its own centre. A
   * farther surface goes on behind a nearer one; the other way round shards would stand up from
   * surfaces seen at a grazing angle, whose rows are far apart in depth. */
  [[nodiscard]] StripPlace own_lower (int x) const
  {
    if (!below_ || below_[x] == kInvalidDepth)
      return kFarAfter;
    return near (depth_[x], below_[x]) ? kCentre : below_[x] < depth_[x] ? kFullAfter : kFarAfter;
  }

  /* The next pixel of the band after x, or -1. */
  [[nodiscard]] int next_in_band (int x) const
  {
    const int last = std::min (width_ - 1, x + 1 + settings_.max_gap);
    for (int n = x + 1; n <= last; n++)
      if (depth_[n] != kInvalidDepth)
        return near (depth_[x], depth_[n]) ? n : -1;
    return -1;
  }

  /* Whether the vertices of two pixels of this row are alike but for their column. */
  [[nodiscard]] bool same_pair (int a, int b) const
  {
    if (depth_[a] != depth_[b] || met_[a] != met_[b] ||
        !same_colour (image_.colour.at (a, row_), image_.colour.at (b, row_)))
      return false;
    const StripPlace own = own_lower (a);
    if (own != own_lower (b))
      return false;
    return own != kCentre || (below_[a] == below_[b] && same_colour (image_.colour.at (a, row_ + 1),
                                                            image_.colour.at (b, row_ + 1)));
  }

  /* Whether the step from pixel a to b can use what lies below them: both of its triangles then
   * have depths that are near, each to each. */
  [[nodiscard]] bool step_fits_below (int a, int b) const
  {
    const int low_a = joins_below (a) ? below_[a] : depth_[a];
    const int low_b = joins_below (b) ? below_[b] : depth_[b];
    return near (low_a, depth_[b]) && near (low_a, low_b);
  }

  /* Begins a piece at v: two equal vertices and the last one's repetition join it to what is
   * there. */
  void begin_piece (StripVertex v)
  {
    if (to_.empty ())
      return;
    to_.push_back (to_.back ());
    to_.push_back (v);
  }

  /* A band begins where the one above ends, or at the upper edge of its pixels. */
  [[nodiscard]] StripVertex upper (int x, StripPlace horizontal) const
  {
    return strip_vertex (x, row_, horizontal, met_[x] ? kCentre : kBefore);
  }

  /* The two vertices of a pixel, or of an end of the band beside it. */
  void pair (int x, bool joined, StripPlace horizontal = kCentre)
  {
    to_.push_back (upper (x, horizontal));
    const StripPlace own = own_lower (x);
    to_.push_back (joined ? strip_vertex (x, row_ + 1, horizontal, kCentre)
                          : strip_vertex (x, row_, horizontal, own == kCentre ? kFarAfter : own));
  }

  void rectangle (int x)
  {
    begin_piece (strip_vertex (x, row_, kBefore, kBefore));
    to_.push_back (strip_vertex (x, row_, kBefore, kBefore));
    to_.push_back (strip_vertex (x, row_, kBefore, kAfter));
    to_.push_back (strip_vertex (x, row_, kAfter, kBefore));
    to_.push_back (strip_vertex (x, row_, kAfter, kAfter));
    result_.triangles += 2;
  }

  /* A pixel of a band, the ones before it (itself: none) and after it (negative: none), and whether
   * the steps to them can use what lies below. */
  struct BandPixel {
    int before, x, after;
    bool fits_before, fits_after;
  };

  void add_to_band (const BandPixel &p)
  {
    const bool joined = joins_below (p.x);
    meets_[p.x] = joined ? p.fits_before && p.fits_after : own_lower (p.x) == kFullAfter;
    const bool inside_piece = settings_.merge && p.before == p.x - 1 && p.after == p.x + 1 &&
                              same_pair (p.before, p.x) && same_pair (p.x, p.after);
    if (!inside_piece) {
      pair (p.x, joined && p.fits_before);
      result_.triangles += 2;
    }
    if (joined && p.fits_before != p.fits_after) {
      begin_piece (upper (p.x, kCentre));
      pair (p.x, p.fits_after);
    }
  }

  /* @return the column after the band */
  int band (int first)
  {
    BandPixel p{first, first, next_in_band (first), true, true};
    result_.points++;
    if (p.after < 0) {
      rectangle (first);
      result_.isolated++;
      return first + 1;
    }
    begin_piece (upper (first, kFarBefore));
    pair (first, joins_below (first), kFarBefore);
    for (; p.after >= 0; p = {p.x, p.after, next_in_band (p.after), p.fits_after, true}) {
      p.fits_after = step_fits_below (p.x, p.after);
      add_to_band (p);
      result_.points++;
    }
    add_to_band (p);
    pair (p.x, joins_below (p.x), kFarAfter);
    result_.triangles += 2;
    result_.strips++;
    return p.x + 1;
  }

  void bands_of_row ()
  {
    for (int x = 0; x < width_;)
      x = depth_[x] == kInvalidDepth ? x + 1 : band (x);
  }

  void pixels_of_row ()
  {
    for (int x = 0; x < width_; x++) {
      if (depth_[x] == kInvalidDepth)
        continue;
      result_.points++;
      if (settings_.mode == StripMode::kRectangles)
        rectangle (x);
      else
        to_.push_back (strip_vertex (x, row_, kCentre, kCentre));
    }
  }

  const ConstRangeImage &image_;
  const StripSettings &settings_;
  std::vector<StripVertex> &to_;
  StripResult &result_;
  const int width_, height_;
  const int step_; /* of 65536 */
  const std::uint16_t *depth_ = nullptr, *below_ = nullptr;
  int row_ = 0;
  bool columns_[2][kMaxStripSide] = {};
  bool *met_ = columns_[0];   /* columns where the row above reaches down to this one's pixels */
  bool *meets_ = columns_[1]; /* and where this row does to the next one's */
};

} // namespace

void
build_strips (const ConstRangeImage &image, const StripSettings &settings,
    std::vector<StripVertex> &to, StripResult &result)
{
  to.clear ();
  if (!image.roi.empty ())
    Builder (image, settings, to, result).build ();
}

} // namespace rangecast
