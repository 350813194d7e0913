/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <rangecast/roi/bounding_box.hpp>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

struct Picture {
  Image<std::uint16_t> depth{20, 10};
  Image<Rgbx> colour{20, 10};
  ConstRangeImage image () { return {0, {100, 50, 20, 10}, depth.view (), colour.view (), 0}; }
};

} // namespace

TEST (BoundingBox, nothing_valid_is_empty)
{
  Picture picture;
  EXPECT_EQ (bounding_box (picture.image (), 5), (Roi{}));
}

TEST (BoundingBox, one_pixel_is_a_box_of_one)
{
  Picture picture;
  picture.depth.view ().at (7, 3) = 1;
  EXPECT_EQ (bounding_box (picture.image (), 0), (Roi{107, 53, 1, 1}));
}

TEST (BoundingBox, holds_the_outermost_pixels)
{
  Picture picture;
  picture.depth.view ().at (19, 4) = 1;
  picture.depth.view ().at (2, 1) = 1;
  picture.depth.view ().at (5, 9) = 1;
  EXPECT_EQ (bounding_box (picture.image (), 0), (Roi{102, 51, 18, 9}));
}

TEST (BoundingBox, margin_ends_at_the_roi)
{
  Picture picture;
  picture.depth.view ().at (2, 1) = 1;
  EXPECT_EQ (bounding_box (picture.image (), 3), (Roi{100, 50, 6, 5}));
}

TEST (BoundingBox, empty_roi_is_empty)
{
  EXPECT_EQ (bounding_box ({}, 4), (Roi{}));
}
