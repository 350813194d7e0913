/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "../base/parallel.hpp"
#include "../geometry/image_view.hpp"
#include "../surface/painting.hpp"

namespace rangecast {

/** Draws frame sets without a GPU, as the shaders of lib/rangecast/surface/shaders.hpp do with one:
 *
 *  1. Vertices of all layers are projected.
 *  2. Bands of rows: each view's triangles into a cell of its own, colour, weight and nearness of
 * the nearest; then colours of the cells within the blend range are added up by weight.
 *  3. Rows: background, smooth outlines, small gaps filled.
 *
 *  The picture does not depend on the number of threads, nor on the processor. Keeps its memory
 * from one picture to the next: 16 bytes a vertex, 8 a covered pixel, and for each thread one band
 * of 8 bytes a pixel and cell. For one thread at a time. */
class SoftwareRenderer {
public:
  /** @param threads  0 = core_count() */
  explicit SoftwareRenderer (int threads = 0) : threads_ (threads) {}

  /** Draws one picture, or the part of it that `picture` names.
   *  @param out      of the picture's whole size; bytes R G B A
   *  @param is_bgra  bytes are B G R A instead */
  void draw (const SurfacePicture &picture, std::span<const SurfaceLayer> layers,
      const ImageView<Rgbx> &out, bool is_bgra = false);

private:
  friend class Drawing;
  /* Arrays by vertex, so that lanes hold successive triangles of a strip. */
  struct Vertices {
    std::vector<float> x, y;     /* pixels of the covered part, in sixteenths */
    std::vector<float> nearness; /* 1 / distance in metres; 0: cannot be drawn */
    std::vector<Rgbx> colours;   /* x is the fourth root of the weight, 255 = 1 */
  };
  /* Successive triangles, or points, of a layer. Two vertices are also of the next chunk's. */
  struct Chunk {
    std::size_t layer, from;     /* its first vertex in that layer */
    std::size_t first, vertices; /* the same in vertices_, and how many */
    int top, bottom;             /* rows that they may reach; bottom < top: none */
  };
  struct Band {
    std::vector<float> nearness;
    std::vector<std::uint32_t> colours;
  };

  const int threads_;
  Vertices vertices_;        /* of all chunks */
  std::vector<float> sizes_; /* of points, pixels */
  std::vector<Chunk> chunks_;
  std::vector<double> alignments_;
  std::vector<std::size_t> cell_of_; /* by number of the layer */
  WorkerMemory<Band> bands_;
  /* Of the covered part, and one pixel more on each side that repeats its last one. */
  std::vector<std::uint32_t> sums_;
  std::vector<float> nearness_;
};

} // namespace rangecast
