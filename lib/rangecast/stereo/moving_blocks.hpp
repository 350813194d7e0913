/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Blocks of 8 x 8 pixels of an image; those at its right and lower edges may be smaller. Motion
 * and change are decided by block, because noise and slow motion of a single pixel look alike. */
struct BlockGrid {
  static constexpr int kBlock = 8; ///< pixels
  int columns = 0, rows = 0;

  BlockGrid () = default;
  explicit BlockGrid (const cv::Size &image)
      : columns ((image.width + kBlock - 1) / kBlock), rows ((image.height + kBlock - 1) / kBlock)
  {
  }
  [[nodiscard]] std::size_t count () const { return std::size_t (columns) * std::size_t (rows); }
  [[nodiscard]] std::size_t at (int bx, int by) const { return std::size_t (by * columns + bx); }
  /** The blocks that have pixels of a part of the image. */
  [[nodiscard]] cv::Rect touched (const cv::Rect &part) const
  {
    const int x = part.x / kBlock, y = part.y / kBlock;
    return cv::Rect (x, y, (part.br ().x + kBlock - 1) / kBlock - x,
               (part.br ().y + kBlock - 1) / kBlock - y) &
           cv::Rect (0, 0, columns, rows);
  }
};

/** Temporal noise filter of one camera's images: the mean of up to ten images where nothing moves.
 * Blocks that differ from the mean by more than noise, and their neighbours, restart. */
class StillAverage {
public:
  void reset () { blocks_.clear (); }

  /** @param image  CV_8UC4; a change of size restarts
   *  @param part   where the mean is needed; elsewhere it may be that of earlier images
   *  @return the mean, of the same type; valid until the next call */
  const cv::Mat &add (const cv::Mat &image, const cv::Rect &part);

  /** Of how many images the mean of a pixel's block is; 1 = it moves. */
  [[nodiscard]] int images_at (int x, int y) const
  {
    return blocks_[grid_.at (x / BlockGrid::kBlock, y / BlockGrid::kBlock)].images;
  }

private:
  struct Block {
    float drift = 0, change = 0; /* grey levels: change of the block's mean, and of its pixels */
    int images = 1;              /* since the restart, at most kFrames */
    bool moves = false;
  };
  /* Rectangles of blocks. */
  void compare (const cv::Mat &image, const cv::Rect &part);
  void find_motion (const cv::Rect &part);
  void average (const cv::Mat &image, const cv::Rect &part);

  BlockGrid grid_;
  cv::Mat sum_, mean_; /* CV_16SC4, levels times 128; CV_8UC4 */
  std::vector<Block> blocks_;
  std::vector<float> changes_;
};

/** Where an image has changed since the last one that was matched completely, and which blocks may
 * have depth: those that had depth in the last image, those that have changed, and their
 * neighbours. Reuses its memory between images. */
class ChangedBlocks {
public:
  /** @param image  size of all images */
  void set (const cv::Size &image);
  /** Forgets all images. */
  void reset () { has_reference_ = knows_depth_ = false; }

  /** Computes the blocks' means, of every second row. @param image  CV_8UC4, R G B x */
  void update (const cv::Mat &image);
  /** Makes the last image the reference; update() must follow. */
  void set_reference ();

  /** Whether two or more blocks completely outside of the ROI (pixels) differ from the reference by
   * more than 10 grey levels in one channel; one may be a reflection. True without reference. */
  [[nodiscard]] bool changed_outside (const Roi &roi) const;

  /** Records the blocks with depth. */
  void learn (const RangeImage &image);

  /** Rectangles of pixels that cover the blocks that may have depth, one below the other, each as
   * wide as its rows need. Few, because rows above and below each one must be matched, too.
   *  @param roi  inside the image; rectangles may extend one block beyond it
   *  @return null if nothing is known: the whole ROI */
  const std::vector<cv::Rect> *find (const Roi &roi);

private:
  [[nodiscard]] bool differs (std::size_t block, int max_levels) const;
  void mark (const Roi &roi);
  void divide ();

  /* Columns of interest in a row of blocks, without x1. */
  struct Row {
    int x0, x1;
  };
  BlockGrid grid_;
  std::vector<cv::Vec4b> means_, reference_;
  std::vector<std::uint16_t> sums_; /* of a row of blocks, by column of pixels and channel */
  std::vector<std::uint8_t> had_depth_;
  bool has_reference_ = false, knows_depth_ = false;
  int first_row_ = 0;
  std::vector<Row> of_interest_;  /* from first_row_ on */
  std::vector<float> cost_;       /* of covering the rows from here to the end */
  std::vector<std::size_t> next_; /* first row of the next rectangle */
  std::vector<cv::Rect> parts_;
};

} // namespace rangecast
