/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "../base/parallel.hpp"

namespace rangecast {

/** Semi-global matching along rows and columns, both ways (H. Hirschmueller, "Stereo processing by
 *  semiglobal matching and mutual information", PAMI 30, 2008). The matching cost compares the
 * differences of each pixel to 16 of its neighbours, clipped to kMaxDifference grey levels: a
 * census transform (R. Zabih, J. Woodfill, "Non-parametric local transforms for computing visual
 * correspondence", ECCV 1994) with 15 levels instead of two, so that noise costs less than texture,
 * and strong texture no more than that of hair or skin. The grey level itself has a small weight
 * (S. Birchfield, C. Tomasi, "A pixel dissimilarity measure that is insensitive to image sampling",
 * PAMI 20, 1998). Half the size is matched first, which is likely right where the picture is plain;
 * of many disparities, only those around what was found there in and near each tile are searched
 * (M. Rothermel et al., "SURE: photogrammetric surface reconstruction from imagery", LC3D workshop
 * 2012). Results depend neither on the number of threads nor on the processor. Reuses its memory
 * between images. */
class SemiGlobalMatcher {
public:
  /** @param left, right    CV_8U, the same size, rows agree
   *  @param min_disparity  pixels; left x minus right x
   *  @param disparities    number of disparities, > 0
   *  @param n_threads      0 = one per core
   *  @param[out] disparity CV_16S, 1/16 pixel; 16 * min_disparity - 16 = no match, as in columns
   * whose disparities are not all inside the right image */
  void match (const cv::Mat &left, const cv::Mat &right, int min_disparity, int disparities,
      int n_threads, cv::Mat &disparity);

private:
  using Costs = std::vector<std::uint8_t>;
  /* Scratch memory of one thread. */
  struct Memory {
    Costs transformed[2], low, high;  /* of a row: see transform_row(), range_of_row() */
    Costs jumps;                      /* of a band, by column and row */
    Costs costs, rests;               /* of a band, by column, disparity and row */
    Costs path, realigned;            /* by disparity: costs of the last pixels of paths */
    Costs last;                       /* of a row of a tile, by disparity: rests of all paths */
    std::vector<std::uint32_t> right; /* of a row: see check_row() */
  };
  /* The disparities to search in a tile of kSide x kSide pixels. */
  struct Tile {
    int low, count;
    std::size_t at; /* of its first cost: they lie by row, disparity and column */
  };
  /* The part to match: `columns` from x0 on, `rows` from y0 on. */
  struct Stripe {
    cv::Mat left;
    int x0, columns, y0, rows;
    int across, bands; /* number of tiles */
  };
  /* The best disparities of all pixels, by row and column of tiles. */
  struct Matches {
    std::vector<std::int16_t> disparity; /* 1/16 pixel */
    std::vector<std::int16_t> whole;     /* pixels */
    std::vector<std::uint8_t> sum;       /* cost */
  };
  void find_coarse (const cv::Mat &left, const cv::Mat &right, int n_threads);
  void choose_disparities (int x, int y, int across, Tile &tile) const;
  void add_bands (Stripe &stripe);
  void match_stripe (const Stripe &stripe, int y, int end, int n_threads, cv::Mat &disparity);
  static void realign (const Tile &from, const Tile &to, Memory &memory);
  template <typename Lanes> void compare_band (const Stripe &stripe, int band, Memory &memory);
  template <typename Lanes>
  void find_jumps_of_band (const Stripe &stripe, int band, Memory &memory);
  template <typename Lanes> void walk_band (const Stripe &stripe, int band, Memory &memory);
  template <typename Lanes> void walk_columns (const Stripe &stripe, int column, Memory &memory);
  template <typename Lanes>
  void choose (const Stripe &stripe, const Tile &tile, int x, int y, const std::uint8_t *most,
      Memory &memory);
  void check_row (const Stripe &stripe, int y, Memory &memory, cv::Mat &disparity) const;

  static constexpr std::size_t kTileArea = 32 * 32;
  /* End of its costs. */
  static std::size_t end_of (const Tile &tile)
  {
    return tile.at + std::size_t (tile.count) * kTileArea;
  }

  bool checks_right_ = true; /* whether matches must be those of their right pixels, too */
  bool has_coarse_ = false;  /* half the size was matched */
  int min_disparity_ = 0, disparities_ = 0, coarse_min_ = 0;
  cv::Mat padded_[2]; /* CV_8U: left and right */
  std::vector<Tile> tiles_;
  Costs costs_, rests_; /* of the tiles: matching costs; what costs along paths leave of 255 */
  Matches matches_;
  WorkerMemory<Memory> memory_;
  std::unique_ptr<SemiGlobalMatcher> coarse_; /* for half the size */
  cv::Mat half_[2], contrast_, coarse_disparity_;
  cv::Mat likely_; /* the same where the picture is plain */
};

} // namespace rangecast
