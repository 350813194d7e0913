/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "strips.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace rangecast {
namespace {

/* Depth, R, G, B of a pixel, or differences or tolerances of them. */
using PixelLanes = float __attribute__ ((vector_size (16)));

/* Whether any lane of a comparison is true. */
bool
any (decltype (PixelLanes{} < PixelLanes{}) test)
{
  using Halves = long long __attribute__ ((vector_size (16)));
  const auto halves = reinterpret_cast<Halves> (test);
  return (halves[0] | halves[1]) != 0;
}

/* 1 / n */
constexpr auto kShares = [] {
  std::array<float, kMaxPieceLength + 1> shares{};
  for (int n = 1; n <= kMaxPieceLength; n++)
    shares[static_cast<std::size_t> (n)] = 1 / float (n);
  return shares;
}();

/* The straight lines from one pixel that pass all later ones within a tolerance: a range of slopes
 * (J. Sklansky, V. Gonzalez, "Fast polygonal approximation of digitized curves", Pattern
 * Recognition 12, 1980). */
class Cone {
public:
  void begin (PixelLanes from)
  {
    from_ = from;
    min_slope_ = PixelLanes{-1e9f, -1e9f, -1e9f, -1e9f};
    max_slope_ = -min_slope_;
  }
  /** Whether a line from the first pixel to that one, n pixels on, passes all between within their
   *  tolerances. If so, later lines must pass this one, too. */
  bool extend (PixelLanes to, int n, PixelLanes tolerance)
  {
    const float share = kShares[static_cast<std::size_t> (n)];
    const PixelLanes way = to - from_, slope = way * share;
    if (any ((slope < min_slope_) | (slope > max_slope_)))
      return false;
    const PixelLanes low = (way - tolerance) * share, high = (way + tolerance) * share;
    min_slope_ = low > min_slope_ ? low : min_slope_;
    max_slope_ = high < max_slope_ ? high : max_slope_;
    return true;
  }

private:
  PixelLanes from_{}, min_slope_{}, max_slope_{};
};

class StripBuilder {
public:
  StripBuilder (const ConstRangeImage &image, const StripSettings &settings,
      std::vector<StripVertex> &to, StripResult &result, const BlendPlanes *planes)
      : image_ (image), colour_ (planes ? planes->colour_plane () : image.colour), planes_ (planes),
        settings_ (settings), to_ (to), result_ (result),
        width_ (std::min (image.depth.width, kMaxStripSide)),
        height_ (std::min (image.depth.height, kMaxStripSide)),
        step_ (static_cast<int> (settings.depth_step * 65536)),
        tolerance_ (tolerances (planes ? kMergeDepthBlend : kMergeDepth, kMergeColour))
  {
  }

  void build ()
  {
    if (is_banded ())
      choose_kept (0, kept_below_);
    for (int y = 0; y < height_; y++) {
      depth_ = image_.depth.row (y);
      row_ = y;
      if (is_banded ()) {
        std::swap (kept_, kept_below_);
        if (y + 1 < height_)
          choose_kept (y + 1, kept_below_);
        look_below ();
        bands_of_row ();
      } else
        pixels_of_row ();
    }
  }

private:
  /* Lane 0 as a share of the depth. More than 0, so that rounding is within them. */
  static PixelLanes tolerances (double depth, double colour)
  {
    const auto c = static_cast<float> (colour) + 1e-3f;
    return PixelLanes{static_cast<float> (depth) + 1e-7f, c, c, c};
  }

  [[nodiscard]] bool is_banded () const
  {
    return settings_.mode == StripMode::kBlend || settings_.mode == StripMode::kStrips;
  }

  [[nodiscard]] bool near (int a, int b) const
  {
    return static_cast<std::int64_t> (std::abs (a - b)) * 65536 <=
           static_cast<std::int64_t> (std::min (a, b)) * step_;
  }

  /* Whether neighbours, both valid, are of one surface. */
  [[nodiscard]] bool joins_pixel_right (int x, int y) const
  {
    return planes_ ? (colour_.at (x, y).x & kJoinsRight) != 0
                   : near (image_.depth.at (x, y), image_.depth.at (x + 1, y));
  }
  [[nodiscard]] bool joins_pixel_below (int x) const
  {
    return planes_ ? (colour_.at (x, row_).x & kJoinsBelow) != 0
                   : near (depth_[x], image_.depth.at (x, row_ + 1));
  }

  /* The lower vertex of a pixel: on the pixel so many rows below, or, if 0, at `place` about the
   * pixel itself. */
  struct Lower {
    std::uint16_t rows = 0;
    StripPlace place = kCentre;
    std::uint16_t depth = kInvalidDepth; /* of the pixel */
  };

  /* A farther surface goes on behind a nearer one; the other way round, slivers would
   * stick out of surfaces seen at a grazing angle, whose rows are far apart in depth. */
  [[nodiscard]] Lower lower_of (int x) const
  {
    const int last = std::min (height_ - 1, row_ + 1 + kMaxStripGap);
    for (int y = row_ + 1; y <= last; y++)
      if (const std::uint16_t depth = image_.depth.at (x, y); depth != kInvalidDepth) {
        if (y == row_ + 1 ? joins_pixel_below (x) : near (depth_[x], depth))
          return {static_cast<std::uint16_t> (y - row_), kCentre, depth};
        return {
            0, !planes_ && y == row_ + 1 && depth < depth_[x] ? kFullAfter : kFarAfter, depth_[x]};
      }
    return {0, kFarAfter, depth_[x]};
  }

  /* Finds what is above and below each pixel of the row. */
  void look_below ()
  {
    const std::uint16_t *below = row_ + 1 < height_ ? image_.depth.row (row_ + 1) : nullptr;
    for (int x = 0; x < width_; x++) {
      met_[x] = row_ > 0 && reach_[x] == row_;
      if (depth_[x] == kInvalidDepth)
        continue;
      if (below && below[x] != kInvalidDepth && joins_pixel_below (x))
        lower_[x] = {1, kCentre, below[x]};
      else
        lower_[x] = lower_of (x);
    }
  }

  [[nodiscard]] bool joins_below (int x) const { return lower_[x].rows > 0; }

  /* The next pixel of the band after x, or -1. */
  [[nodiscard]] int next_in_band (int x) const
  {
    const int last = std::min (width_ - 1, x + 1 + kMaxStripGap);
    for (int n = x + 1; n <= last; n++)
      if (depth_[n] != kInvalidDepth)
        return (n == x + 1 ? joins_pixel_right (x, row_) : near (depth_[x], depth_[n])) ? n : -1;
    return -1;
  }

  /* Which pixels of a row stay when those on lines between them are left out. */
  void choose_kept (int y, bool *kept) const
  {
    const std::uint16_t *depth = image_.depth.row (y);
    const Rgbx *colour = colour_.row (y);
    std::fill_n (kept, width_, false);
    Cone cone;
    PixelLanes before{};
    int first = -1; /* where the piece begins; -1: none does */
    for (int x = 0; x < width_; x++) {
      const bool on = first >= 0 && depth[x] != kInvalidDepth && joins_pixel_right (x - 1, y);
      if (first >= 0 && !on) {
        kept[x - 1] = true;
        first = -1;
      }
      if (depth[x] == kInvalidDepth)
        continue;
      const PixelLanes here = {
          float (depth[x]), float (colour[x].r), float (colour[x].g), float (colour[x].b)};
      if (!on) {
        kept[x] = true;
        cone.begin (here);
        first = x;
        before = here;
        continue;
      }
      const bool copy = depth[x] == depth[x - 1] && colour[x].r == colour[x - 1].r &&
                        colour[x].g == colour[x - 1].g && colour[x].b == colour[x - 1].b;
      /* How far the pixel may be off a line that omits it. One that equals the pixel before it may
       * be a copy, which the neighbour code put there for something near. */
      const PixelLanes &shares = copy ? copy_tolerance_ : tolerance_;
      const PixelLanes off = {shares[0] * float (depth[x]), shares[1], shares[2], shares[3]};
      if (x - first > kMaxPieceLength || !near (depth[first], depth[x]) ||
          !cone.extend (here, x - first, off) || has_weight_step (first, x, y)) {
        kept[x - 1] = true;
        cone.begin (before);
        cone.extend (here, 1, off);
        first = x - 1;
      }
      before = here;
    }
    if (first >= 0)
      kept[width_ - 1] = true;
  }

  /* Whether weights within a piece are far from what they are at its first pixel. */
  [[nodiscard]] bool has_weight_step (int first, int x, int y) const
  {
    constexpr int kFar = 80; /* of 255 */
    const auto weight = [&] (int at) {
      return planes_
          ->weight[static_cast<std::size_t> (y) * static_cast<std::size_t> (planes_->width) +
                   static_cast<std::size_t> (at)];
    };
    return planes_ && std::abs (weight (x) - weight (first)) > kFar;
  }

  /* Whether the step from pixel a to b can use what lies below them: both of its triangles then
   * have depths that are near, each to each. */
  [[nodiscard]] bool step_fits_below (int a, int b) const
  {
    if (planes_ && lower_[a].rows == 1 && lower_[b].rows == 1 && b == a + 1 &&
        !joins_pixel_right (a, row_ + 1))
      return false;
    return near (lower_[a].depth, depth_[b]) && near (lower_[a].depth, lower_[b].depth);
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
    to_.push_back (
        joined ? strip_vertex (x, row_ + lower_[x].rows, horizontal, kCentre)
               : strip_vertex (x, row_, horizontal, joins_below (x) ? kFarAfter : lower_[x].place));
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

  /* Whether the step from a to b goes on as steps inside a surface do: along the band, both bands
   * at the row below met or both not. */
  [[nodiscard]] bool is_plain_step (int a, int b, bool fits) const
  {
    return b == a + 1 && met_[a] == met_[b] && lower_[a].rows == lower_[b].rows &&
           lower_[a].place == lower_[b].place &&
           (lower_[a].rows == 0 || (lower_[a].rows == 1 && fits));
  }

  /* Whether the band covers all between a pixel and the one below that it joins. */
  [[nodiscard]] bool meets_below (const BandPixel &p) const
  {
    const auto as_far = [&] (int x) { return lower_[x].rows >= lower_[p.x].rows; };
    return p.fits_before && p.fits_after &&
           (lower_[p.x].rows == 1 || (as_far (p.before) && as_far (std::max (p.x, p.after))));
  }

  void add_to_band (const BandPixel &p)
  {
    const bool joined = joins_below (p.x);
    if (joined ? meets_below (p) : lower_[p.x].place == kFullAfter)
      reach_[p.x] = row_ + std::max<int> (1, lower_[p.x].rows);
    const bool inside = p.before < p.x && p.after > p.x &&
                        is_plain_step (p.before, p.x, p.fits_before) &&
                        is_plain_step (p.x, p.after, p.fits_after);
    if (inside) {
      add_inner (p.x, joined);
      return;
    }
    pair (p.x, joined && p.fits_before);
    result_.triangles += 2;
    if (joined && p.fits_before != p.fits_after) {
      begin_piece (upper (p.x, kCentre));
      pair (p.x, p.fits_after);
    }
  }

  /* Adds a pixel inside the band, of which either vertex or both may be omitted. One vertex alone
   * makes one triangle, and a degenerate one with the other vertex repeated. */
  void add_inner (int x, bool joined)
  {
    const bool keeps_upper = kept_[x], keeps_lower = joined ? kept_below_[x] : kept_[x];
    if (!keeps_upper && !keeps_lower)
      return;
    const StripVertex last_upper = to_[to_.size () - 2], last_lower = to_.back ();
    pair (x, joined);
    if (!keeps_upper)
      to_[to_.size () - 2] = last_upper;
    if (!keeps_lower)
      to_.back () = last_lower;
    result_.triangles += static_cast<std::uint64_t> (keeps_upper) + keeps_lower;
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
  const ImageView<const Rgbx> colour_;
  const BlendPlanes *const planes_; /* or nullptr */
  const StripSettings &settings_;
  std::vector<StripVertex> &to_;
  StripResult &result_;
  const int width_, height_;
  const int step_; /* of 65536 */
  const PixelLanes tolerance_;
  const PixelLanes copy_tolerance_ = tolerances (kMergeCopyDepth, kMergeCopyColour);
  const std::uint16_t *depth_ = nullptr;
  int row_ = 0;
  /* by column */
  bool flags_[3][kMaxStripSide] = {};
  bool *met_ = flags_[0];  /* a band above reaches down to this row's pixel */
  bool *kept_ = flags_[1]; /* this row's pixel is not left out */
  bool *kept_below_ = flags_[2];
  Lower lower_[kMaxStripSide];
  int reach_[kMaxStripSide] = {}; /* the row to which the last band came down; 0: to none */
};

} // namespace

void
build_strips (const ConstRangeImage &image, const StripSettings &settings,
    std::vector<StripVertex> &to, StripResult &result, const BlendPlanes *planes)
{
  to.clear ();
  if (!image.roi.empty ())
    StripBuilder (image, settings, to, result, planes).build ();
}

void
make_vertices (const ConstRangeImage &image, const BlendPlanes *planes,
    std::span<const StripVertex> strips, int reach, std::vector<SurfaceVertex> &to)
{
  std::array<std::int16_t, 8> offsets; /* by StripPlace */
  for (int i = 0; i < 8; i++)
    offsets[static_cast<std::size_t> (i)] =
        static_cast<std::int16_t> (std::clamp (i - int (kCentre), -reach, reach));
  const auto depth_at = [&] (int x, int y, std::size_t at) {
    const int here = image.depth.at (x, y);
    if (!planes)
      return static_cast<std::uint16_t> (here);
    const Rgbx *flags = &planes->colour[at];
    int sum = here, n = 1;
    if (x > 0 && (flags[0].x & flags[-1].x & kJoinsRight))
      sum += image.depth.at (x - 1, y) + image.depth.at (x + 1, y), n += 2;
    if (y > 0 && (flags[0].x & flags[-image.depth.width].x & kJoinsBelow))
      sum += image.depth.at (x, y - 1) + image.depth.at (x, y + 1), n += 2;
    return static_cast<std::uint16_t> ((sum + n / 2) / n);
  };
  to.resize (strips.size ());
  for (std::size_t i = 0; i < strips.size (); i++) {
    const StripVertex v = strips[i];
    const int x = static_cast<int> (v & 8191), y = static_cast<int> (v >> 13 & 8191);
    const std::size_t at =
        static_cast<std::size_t> (y) * static_cast<std::size_t> (image.depth.width) +
        static_cast<std::size_t> (x);
    Rgbx colour = planes ? planes->colour[at] : image.colour.at (x, y);
    colour.x = planes ? planes->weight[at] : 255;
    to[i] = {static_cast<std::int16_t> (4 * x + offsets[v >> 26 & 7]),
        static_cast<std::int16_t> (4 * y + offsets[v >> 29]), depth_at (x, y, at), 0, colour};
  }
}

} // namespace rangecast
