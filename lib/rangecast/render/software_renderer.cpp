/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "software_renderer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>
#include <utility>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr int kBandRows = 16;
constexpr std::size_t kChunkVertices = 256;
/* Fourth roots of weights as in shaders.cpp, 255 = 1: of an inside, the least of an outside, and
 * what tells both from each other in a sum. */
constexpr std::uint8_t kInside = 1;
constexpr float kMinOutside = 10;
constexpr std::uint32_t kOutside = 5;
constexpr float kMinAngle = 0.03f; /* square root of the minimum weight */

using Vec4 = float __attribute__ ((vector_size (16)));

float
weight_of (std::uint8_t root)
{
  const float r = static_cast<float> (root) * (1 / 255.f), square = r * r;
  return square * square;
}

template <typename L>
typename L::F
floats (const typename L::U &values)
{
  return __builtin_convertvector((typename L::I)values, typename L::F);
}

/* Slivers may yield a little less than 0 or more than 255. */
template <typename L>
typename L::U
bytes (const typename L::F &values)
{
  const typename L::F zero{}, most = zero + 255, low = values > 0 ? values : zero;
  return (typename L::U) __builtin_convertvector((low < most ? low : most) + 0.5f, typename L::I);
}

/* 0, 1, 2, ... */
template <typename L>
typename L::I
count ()
{
  typename L::I lanes;
  for (int l = 0; l < L::kLanes; l++)
    lanes[l] = l;
  return lanes;
}

Vec4
channels (const Rgbx &c)
{
  using Bytes = std::uint8_t __attribute__ ((vector_size (16)));
  using Ints = std::int32_t __attribute__ ((vector_size (16)));
  const Bytes from = (Bytes)Ints{std::bit_cast<std::int32_t> (c)};
  return __builtin_convertvector((Ints)__builtin_shufflevector (from, Bytes{}, 0, 16, 17, 18, 1, 19,
                                     20, 21, 2, 22, 23, 24, 3, 25, 26, 27),
      Vec4);
}

/* A value that changes evenly over a triangle. */
template <typename T> struct Plane {
  T begin, right, down; /* at the first pixel, and its change to the next */
};

} // namespace

/* One call of SoftwareRenderer::draw(). */
class Drawing {
public:
  using Chunk = SoftwareRenderer::Chunk;
  using Band = SoftwareRenderer::Band;

  Drawing (SoftwareRenderer &memory, const SurfacePicture &picture,
      std::span<const SurfaceLayer> layers, const ImageView<Rgbx> &out, bool is_bgra)
      : m_ (memory), picture_ (picture), layers_ (layers), out_ (out), is_bgra_ (is_bgra),
        covered_ (picture.covered),
        stride_ (static_cast<std::size_t> (covered_.width + kMaxLanes) / kMaxLanes * kMaxLanes + 2),
        mirrors_ (mirrors (picture.clip_from_world)),
        is_points_ (picture.mode == StripMode::kPoints)
  {
  }

  void draw ()
  {
    if (!covered_.empty ()) {
      prepare ();
      in_parallel (m_.chunks_.size (), m_.threads_, [this] (std::size_t i) {
        for_this_cpu ([&] (auto lanes) { project<decltype (lanes)> (m_.chunks_[i]); });
      });
      const int bands = (covered_.height + kBandRows - 1) / kBandRows;
      m_.bands_.reserve (workers_for (static_cast<std::size_t> (bands), m_.threads_));
      in_parallel (static_cast<std::size_t> (bands), m_.threads_,
          [this] (std::size_t i, std::size_t worker) {
            const int top = static_cast<int> (i) * kBandRows;
            for_this_cpu ([&] (auto lanes) {
              draw_band<decltype (lanes)> (
                  top, std::min (top + kBandRows, covered_.height), m_.bands_.of (worker));
            });
          });
    }
    const int rows = picture_.part.height, bands = (rows + kBandRows - 1) / kBandRows;
    in_parallel (static_cast<std::size_t> (bands), m_.threads_, [this, rows] (std::size_t i) {
      const int top = static_cast<int> (i) * kBandRows;
      for_this_cpu ([&] (auto lanes) {
        for (int y = top; y < std::min (top + kBandRows, rows); y++)
          finish_row<decltype (lanes)> (picture_.part.y + y);
      });
    });
  }

private:
  void prepare ()
  {
    m_.alignments_.clear ();
    for (const SurfaceLayer &layer : layers_)
      m_.alignments_.push_back (view_alignment (picture_.clip_from_world, *layer.view));
    cells_ = picture_.mode == StripMode::kBlend
                 ? std::clamp<std::size_t> (layers_.size (), 1, kMaxBlendCells)
                 : 1;
    choose_cells (m_.alignments_, cells_, m_.cell_of_);
    range_ =
        depth_shift (picture_.clip_from_world, picture_.clip_from_world, picture_.blend_range_m).g;
    for (std::size_t i = 0; i < layers_.size (); i++)
      cotangents_[m_.cell_of_[i]] = view_cotangent (
          picture_.clip_from_world, *layers_[i].view, m_.cell_of_[i], cells_, layers_.size ());
    m_.chunks_.clear ();
    std::size_t first = 0;
    const std::size_t shared = is_points_ ? 0 : 2; /* vertices with the triangles before */
    for (std::size_t i = 0; i < layers_.size (); i++) {
      const std::size_t size = layers_[i].vertices.size ();
      for (std::size_t at = 0; at + shared < size; at += kChunkVertices) {
        m_.chunks_.push_back ({i, at, first, std::min (kChunkVertices + shared, size - at), 0, 0});
        /* chunks are projected in parallel: padding keeps one from writing into the next */
        first += (m_.chunks_.back ().vertices + kMaxLanes - 1) / kMaxLanes * kMaxLanes;
      }
    }
    for (auto *values : {&m_.vertices_.x, &m_.vertices_.y, &m_.vertices_.nearness})
      values->resize (first + kMaxLanes); /* the last one's vectors are read beyond it */
    m_.vertices_.colours.resize (first);
    m_.sizes_.resize (is_points_ ? first : 0);
    const std::size_t pixels = stride_ * static_cast<std::size_t> (covered_.height + 2);
    m_.sums_.resize (pixels);
    m_.nearness_.resize (pixels);
  }

  /* ---- vertices ---- */

  template <typename L> void project (Chunk &chunk)
  {
    using F = typename L::F;
    const SurfaceLayer &layer = layers_[chunk.layer];
    const Mat4 m = clip_from_pixel (picture_.clip_from_world, *layer.view, layer.image.roi);
    const LayerAngles angles =
        layer_angles (picture_.clip_from_world, *layer.view, layer.image.roi);
    const auto gap =
        static_cast<float> (layer_gap (picture_.mode, picture_.clip_from_world, *layer.view));
    const float unit = angles.unit,
                size = picture_.point_size * picture_.pixels_per_unit * unit * angles.lens[2];
    const float half_width = 0.5f * static_cast<float> (picture_.width),
                half_height = 0.5f * static_cast<float> (picture_.height),
                left = half_width - static_cast<float> (covered_.x),
                up = half_height - static_cast<float> (covered_.y);
    const SurfaceVertex *from = &layer.vertices[chunk.from];
    SoftwareRenderer::Vertices &to = m_.vertices_;
    float top = 1e9f, bottom = -1e9f;
    for (std::size_t begin = 0; begin < chunk.vertices; begin += L::kLanes) {
      const int n = static_cast<int> (std::min<std::size_t> (L::kLanes, chunk.vertices - begin));
      F across{}, down{}, depth{}, weight{};
      for (int l = 0; l < n; l++) {
        const SurfaceVertex &v = from[begin + static_cast<std::size_t> (l)];
        across[l] = v.x;
        down[l] = v.y;
        depth[l] = v.depth;
        weight[l] = v.colour.x;
      }
      across *= 0.25f, down *= 0.25f;
      const F u = across * depth, v = down * depth;
      const auto row = [&] (std::size_t r) -> F {
        return m[r] * u + m[r + 4] * v + m[r + 8] * depth + m[r + 12];
      };
      const F w = row (3), share = 1 / w;
      /* sixteenths, in which edges are exact: adding 1.5 * 2^19 leaves no smaller digits */
      constexpr float kRound = 786432;
      const F x = (row (0) * share * half_width + left) + kRound - kRound,
              y = (row (1) * share * half_height + up) + kRound - kRound;
      const F ray_x = (across - angles.lens[0]) * angles.lens[2],
              ray_y = (down - angles.lens[1]) * angles.lens[3], z = depth * unit,
              way_x = ray_x * z - angles.viewer[0], way_y = ray_y * z - angles.viewer[1],
              way_z = z - angles.viewer[2];
      F norm =
          (ray_x * ray_x + ray_y * ray_y + 1) * (way_x * way_x + way_y * way_y + way_z * way_z);
      L::make_root (norm);
      const F along = (ray_x * way_x + ray_y * way_y + way_z) / norm;
      F cube = along * along * along;
      cube = cube > kMinAngle ? cube : F{} + kMinAngle;
      F root = weight * (1 / 255.f) * cube;
      L::make_root (root);
      root *= 255;
      root = root > kMinOutside ? root : F{} + kMinOutside;
      F nearness = 1 / (w + gap);
      const F reach = x * x + y * y;
      /* not before the near plane, and not so far aside that sixteenths get lost */
      L::keep_where (nearness, (row (2) >= -w) & (w > 0) & (reach < 1e9f));
      L::at (&to.x[chunk.first + begin]) = x;
      L::at (&to.y[chunk.first + begin]) = y;
      L::at (&to.nearness[chunk.first + begin]) = nearness;
      for (int l = 0; l < n; l++) {
        const std::size_t i = begin + static_cast<std::size_t> (l);
        Rgbx &colour = to.colours[chunk.first + i] = from[i].colour;
        colour.x = static_cast<std::uint8_t> (root[l] + 0.5f);
        if (nearness[l] <= 0)
          continue;
        float around = 0;
        if (is_points_)
          around = 0.5f * (m_.sizes_[chunk.first + i] =
                                  std::clamp (size * depth[l] * share[l], 1.f, 16384.f));
        top = std::min (top, y[l] - around);
        bottom = std::max (bottom, y[l] + around);
      }
    }
    chunk.top = static_cast<int> (std::floor (std::max (top, 0.f)));
    chunk.bottom =
        static_cast<int> (std::floor (std::min (bottom, static_cast<float> (covered_.height))));
  }

  /* ---- bands ---- */

  /* Rows of one cell, from `top` to before `end`. */
  struct Target {
    float *nearness;
    std::uint32_t *colours;
    int top, end;
  };

  template <typename L> void draw_band (int top, int end, Band &band)
  {
    const std::size_t size = stride_ * kBandRows;
    band.nearness.resize (cells_ * size + kMaxLanes); /* lanes may go beyond a row */
    band.colours.resize (cells_ * size + kMaxLanes);
    unsigned used = 0; /* bit i: cell i */
    for (const Chunk &chunk : m_.chunks_) {
      if (chunk.bottom < top || chunk.top >= end)
        continue;
      const std::size_t cell = m_.cell_of_[chunk.layer];
      const Target target = {&band.nearness[cell * size], &band.colours[cell * size], top, end};
      if (!(used >> cell & 1))
        std::fill_n (target.nearness, size, 0.f);
      used |= 1u << cell;
      if (is_points_)
        for (std::size_t i = 0; i < chunk.vertices; i++)
          draw_point (target, vertex (chunk.first + i), m_.sizes_[chunk.first + i]);
      else
        draw_strip<L> (target, chunk);
    }
    for (int y = top; y < end; y++)
      add_up<L> (y, static_cast<std::size_t> (y - top) * stride_, used, band, size);
  }

  struct Vertex {
    float x, y, nearness;
    Rgbx colour;
  };
  [[nodiscard]] Vertex vertex (std::size_t i) const
  {
    const SoftwareRenderer::Vertices &v = m_.vertices_;
    return {v.x[i], v.y[i], v.nearness[i], v.colours[i]};
  }

  void draw_point (const Target &to, const Vertex &v, float size) const
  {
    if (v.nearness <= 0)
      return;
    const auto first = [] (float edge, int least) {
      return std::max (static_cast<int> (std::ceil (edge - 0.5f)), least);
    };
    const int right = first (v.x + size / 2, 0), bottom = first (v.y + size / 2, 0);
    const auto colour = std::bit_cast<std::uint32_t> (v.colour);
    for (int y = first (v.y - size / 2, to.top); y < std::min (bottom, to.end); y++)
      for (int x = first (v.x - size / 2, 0); x < std::min (right, covered_.width); x++) {
        const std::size_t at =
            static_cast<std::size_t> (y - to.top) * stride_ + static_cast<std::size_t> (x);
        if (v.nearness > to.nearness[at]) {
          to.nearness[at] = v.nearness;
          to.colours[at] = colour;
        }
      }
  }

  /* Pixels around a triangle whose centres may lie in it; `last` and `bottom` are included. */
  struct Box {
    int first, top, last, bottom;
  };

  /* Draws a chunk's triangles that face the viewer, or do not hide, and contain pixel centres. */
  template <typename L> void draw_strip (const Target &to, const Chunk &chunk)
  {
    using F = typename L::F;
    using I = typename L::I;
    const auto least = [] (const F (&v)[3]) -> F {
      const F both = v[0] < v[1] ? v[0] : v[1];
      return both < v[2] ? both : v[2];
    };
    const auto most = [] (const F (&v)[3]) -> F {
      const F both = v[0] > v[1] ? v[0] : v[1];
      return both > v[2] ? both : v[2];
    };
    /* begin at the first centre within the limit, end at the last one: centres are at halves of a
     * pixel, vertices at sixteenths */
    const auto begin = [] (const F &edge, float limit) -> I {
      const F inside = edge - 0.5f > limit ? edge - 0.5f : F{} + limit;
      return __builtin_convertvector(inside + 15 / 16.f, I);
    };
    const auto end = [] (const F &edge, float limit) -> I {
      const F inside = edge - 0.5f < limit ? edge - 0.5f : F{} + limit;
      return inside < 0 ? I{} - 1 : __builtin_convertvector(inside, I);
    };
    const I lanes = count<L> (), is_odd = (lanes & 1) != 0; /* chunks begin at even numbers */
    for (std::size_t i = 0; i + 2 < chunk.vertices; i += L::kLanes) {
      const auto load = [at = chunk.first + i] (const std::vector<float> &v, F (&values)[3]) {
        for (std::size_t k = 0; k < 3; k++)
          values[k] = L::at (&v[at + k]);
      };
      F x[3], y[3], nearness[3];
      load (m_.vertices_.x, x);
      load (m_.vertices_.y, y);
      load (m_.vertices_.nearness, nearness);
      const F area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
      const I is_front = (area > 0) ^ is_odd ^ (I{} - int (mirrors_)), left = begin (least (x), 0),
              right = end (most (x), float (covered_.width - 1)),
              top = begin (least (y), float (to.top)), bottom = end (most (y), float (to.end - 1));
      const I drawn = (area != 0) & (least (nearness) > 0) & (left <= right) & (top <= bottom) &
                      (lanes < int (chunk.vertices - 2 - i)) &
                      (is_front | (I{} - int (!picture_.culls ())));
      if (!L::any (drawn))
        continue;
      for (int l = 0; l < L::kLanes; l++)
        if (drawn[l])
          draw_triangle<L> (to, chunk.first + i + std::size_t (l), area[l], is_front[l] != 0,
              {left[l], top[l], right[l], bottom[l]});
    }
  }

  /* Draws the pixels whose centres lie in the triangle, or on one of its edges that no neighbour
   * draws: of an edge's two directions one counts. */
  template <typename L>
  void draw_triangle (const Target &to, std::size_t at, float area, bool is_front, const Box &box)
  {
    using F = typename L::F;
    using I = typename L::I;
    using U = typename L::U;
    const Vertex a = vertex (at), b = vertex (area < 0 ? at + 2 : at + 1),
                 c = vertex (area < 0 ? at + 1 : at + 2);
    const float x = static_cast<float> (box.first) + 0.5f, y = static_cast<float> (box.top) + 0.5f;
    /* twice the area between an edge and the pixel */
    const auto edge = [x, y] (const Vertex &p, const Vertex &q) {
      const float way_x = q.x - p.x, way_y = q.y - p.y;
      return Plane<float>{way_x * (y - p.y) - way_y * (x - p.x), -way_y, way_x};
    };
    const Plane<float> of_a = edge (b, c), of_b = edge (c, a), of_c = edge (a, b);
    const auto least = [] (const Plane<float> &e) { /* steps are 1/256 */
      return e.right < 0 || (e.right == 0 && e.down > 0) ? 0 : 1 / 512.f;
    };
    const float least_a = least (of_a), least_b = least (of_b), least_c = least (of_c);
    const float share = 1 / std::abs (area);
    const auto plane = [&] (const auto &at_a, const auto &at_b, const auto &at_c) {
      const auto to_b = (at_b - at_a) * share, to_c = (at_c - at_a) * share;
      return Plane<std::decay_t<decltype (at_a)>>{at_a + of_b.begin * to_b + of_c.begin * to_c,
          of_b.right * to_b + of_c.right * to_c, of_b.down * to_b + of_c.down * to_c};
    };
    const Plane<float> nearness = plane (a.nearness, b.nearness, c.nearness);
    Plane<Vec4> colour = plane (channels (a.colour), channels (b.colour), channels (c.colour));
    if (!is_front) {
      colour.begin[3] = kInside;
      colour.right[3] = colour.down[3] = 0;
    }
    const I lanes = count<L> ();
    for (int row = box.top; row <= box.bottom; row++) {
      const auto n = static_cast<float> (row - box.top);
      const std::size_t line =
          static_cast<std::size_t> (row - to.top) * stride_ + static_cast<std::size_t> (box.first);
      const float edge_a = of_a.begin + n * of_a.down, edge_b = of_b.begin + n * of_b.down,
                  edge_c = of_c.begin + n * of_c.down,
                  near_line = nearness.begin + n * nearness.down;
      for (int column = 0; column <= box.last - box.first; column += L::kLanes) {
        const F right_by = __builtin_convertvector(lanes + column, F);
        const I inside = (edge_a + of_a.right * right_by >= least_a) &
                         (edge_b + of_b.right * right_by >= least_b) &
                         (edge_c + of_c.right * right_by >= least_c) &
                         (lanes + column <= box.last - box.first);
        const F here = near_line + nearness.right * right_by;
        F &nearest = L::at (to.nearness + line + column);
        const I drawn = inside & (here > nearest);
        if (!L::any (drawn))
          continue;
        const Vec4 begin = colour.begin + n * colour.down;
        U packed{};
        for (int channel = 0; channel < 4; channel++)
          packed |= bytes<L> (begin[channel] + colour.right[channel] * right_by) << (8 * channel);
        nearest = drawn ? here : nearest;
        U &there = L::at (to.colours + line + column);
        there = drawn ? packed : there;
      }
    }
  }

  /* Adds up, of each pixel, the colours of all cells that are within the blend range; and the
   * fourth root of the mean weight. */
  template <typename L>
  void add_up (int y, std::size_t line, unsigned used, const Band &band, std::size_t size)
  {
    using F = typename L::F;
    using I = typename L::I;
    using U = typename L::U;
    const std::size_t row = static_cast<std::size_t> (y + 1) * stride_;
    for (int x = 0; x < covered_.width; x += L::kLanes) {
      F nearest{};
      for (std::size_t cell = 0; cell < cells_; cell++)
        if (used >> cell & 1) {
          const F &here = L::at (&band.nearness[cell * size + line + std::size_t (x)]);
          nearest = here > nearest ? here : nearest;
        }
      const F distance = 1 / nearest;
      F red{}, green{}, blue{}, sum{};
      for (std::size_t cell = 0; cell < cells_ && L::any (nearest > 0); cell++)
        if (used >> cell & 1) {
          const std::size_t at = cell * size + line + std::size_t (x);
          const F &here = L::at (&band.nearness[at]);
          const U &c = L::at (&band.colours[at]);
          const F root = floats<L> (c >> 24) * (1 / 255.f), square = root * root;
          F weight = square * square;
          F cotangent = cotangents_[cell].per_w * distance - cotangents_[cell].offset;
          cotangent = cotangent > 0 ? cotangent : F{};
          F range = 1 + cotangent * cotangent;
          L::make_root (range);
          range *= range_;
          L::keep_where (weight, (here > 0) & (here * (1 + range * nearest) >= nearest));
          red += weight * floats<L> (c & 255);
          green += weight * floats<L> (c >> 8 & 255);
          blue += weight * floats<L> (c >> 16 & 255);
          sum += weight;
        }
      const I any = sum > 0;
      F root = sum * (1 / static_cast<float> (cells_));
      L::make_root (root);
      L::make_root (root);
      root *= 255;
      root = root > kInside ? root : F{} + kInside;
      const F share = 1 / (any ? sum : F{} + 1);
      const U packed = bytes<L> (red * share) | bytes<L> (green * share) << 8 |
                       bytes<L> (blue * share) << 16 | bytes<L> (root) << 24;
      L::at (&m_.sums_[row + 1 + std::size_t (x)]) = packed & (U)any;
      L::at (&m_.nearness_[row + 1 + std::size_t (x)]) = nearest;
    }
    std::uint32_t *sums = &m_.sums_[row];
    sums[0] = sums[1];
    sums[covered_.width + 1] = sums[covered_.width];
    if (y == 0)
      std::copy_n (sums, stride_, sums - stride_);
    if (y == covered_.height - 1)
      std::copy_n (sums, stride_, sums + stride_);
  }

  /* ---- the picture ---- */

  /* A gradient in 8 bits shows bands; noise of one level hides them: interleaved gradient noise (J.
   * Jimenez, "Next generation post processing in Call of Duty", SIGGRAPH 2014). */
  void draw_background (int y, Rgbx *to) const
  {
    const Roi &part = picture_.part;
    const float shade = picture_.background_shade, *colour = picture_.background,
                down = (static_cast<float> (y - part.y) + 0.5f) / static_cast<float> (part.height),
                light = 1 + shade * (1 - 2 * down);
    const auto byte = [] (float value) {
      return static_cast<std::uint8_t> (std::clamp (value, 0.f, 255.f) + 0.5f);
    };
    const float r = 255 * light * colour[0], g = 255 * light * colour[1],
                b = 255 * light * colour[2];
    const Rgbx flat = {byte (r), byte (g), byte (b), byte (255 * colour[3])};
    if (shade <= 0) {
      std::fill_n (to, part.width, flat);
      return;
    }
    const auto fraction = [] (float value) { /* of a positive number */
      return value - static_cast<float> (static_cast<int> (value));
    };
    for (int x = 0; x < part.width; x++) {
      const float at = 0.06711056f * (static_cast<float> (x + part.x) + 0.5f) +
                       0.00583715f * (static_cast<float> (y) + 0.5f),
                  noise = fraction (52.9829189f * fraction (at)) - 0.5f;
      to[x] = {byte (r + noise), byte (g + noise), byte (b + noise), flat.x};
    }
  }

  template <typename L> void finish_row (int y)
  {
    using I = typename L::I;
    using U = typename L::U;
    const Roi &part = picture_.part;
    Rgbx *row = out_.row (y) + part.x;
    draw_background (y, row);
    if (y >= covered_.y && y < covered_.y + covered_.height) {
      Rgbx *to = row + (covered_.x - part.x);
      const std::size_t first = static_cast<std::size_t> (y - covered_.y + 1) * stride_ + 1;
      for (int x = 0; x < covered_.width; x += L::kLanes) {
        const std::uint32_t *at = &m_.sums_[first + std::size_t (x)];
        const U &here = L::at (at), &west = L::at (at - 1), &east = L::at (at + 1),
                &north = L::at (at - stride_), &south = L::at (at + stride_);
        if (L::any_of (here | west | east | north | south) == 0)
          continue;
        I whole = (I)(here >> 24) >= int (kOutside);
        if (!is_points_)
          whole &= (west != 0) & (east != 0) & (north != 0) & (south != 0);
        const U opaque = here | 0xff000000u;
        const int n = std::min (int (L::kLanes), covered_.width - x);
        if (n == L::kLanes && !L::any (~whole)) {
          L::at (reinterpret_cast<std::uint32_t *> (to + x)) = opaque;
          continue;
        }
        for (int l = 0; l < n; l++)
          if (whole[l])
            to[x + l] = std::bit_cast<Rgbx> (std::uint32_t (opaque[l]));
          else
            finish_pixel (x + l, y - covered_.y, to[x + l]);
      }
    }
    for (int x = 0; x < part.width && is_bgra_; x++)
      std::swap (row[x].r, row[x].b);
  }

  [[nodiscard]] std::size_t place (int x, int y) const
  {
    return static_cast<std::size_t> (y + 1) * stride_ + static_cast<std::size_t> (x + 1);
  }
  [[nodiscard]] Rgbx sum_at (std::size_t at) const { return std::bit_cast<Rgbx> (m_.sums_[at]); }

  /* Outlines are smoothed over the four neighbours, which also closes cracks of one pixel. Where no
   * camera saw the outside of a surface, small gaps take the colours around them.
   * @param pixel  the background; replaced */
  [[gnu::noinline]] void finish_pixel (int x, int y, Rgbx &pixel) const
  {
    const std::size_t at = place (x, y);
    const Rgbx here = sum_at (at);
    if (is_points_) {
      if (here.x > 0)
        pixel = {here.r, here.g, here.b, 255};
      return;
    }
    const Rgbx around[] = {
        sum_at (at - 1), sum_at (at + 1), sum_at (at - stride_), sum_at (at + stride_)};
    int neighbours = 0, heaviest = here.x;
    Vec4 sum{};
    const auto add = [&sum] (const Rgbx &texel) {
      sum += weight_of (texel.x) * Vec4{float (texel.r), float (texel.g), float (texel.b), 1};
    };
    for (const Rgbx &texel : around)
      neighbours += texel.x > 0;
    float coverage = 0.5f + 0.125f * static_cast<float> (neighbours);
    if (here.x > 0) {
      add (here);
    } else {
      /* up to a half, or a crack */
      coverage = neighbours > 2 ? 1 : 0.125f * static_cast<float> (neighbours);
      for (const Rgbx &texel : around) {
        add (texel);
        heaviest = std::max<int> (heaviest, texel.x);
      }
    }
    if (heaviest == 0)
      return;
    sum /= sum[3];
    if (heaviest < int (kOutside)) {
      const Vec4 filled = fill (x, y);
      sum += filled[3] * (filled - sum);
    }
    const float behind = (1 - coverage) * static_cast<float> (pixel.x) * (1 / 255.f),
                alpha = coverage + behind;
    const Vec4 ground = {float (pixel.r), float (pixel.g), float (pixel.b), 0},
               colour = (coverage * sum + behind * ground) / alpha + 0.5f;
    pixel = {static_cast<std::uint8_t> (colour[0]), static_cast<std::uint8_t> (colour[1]),
        static_cast<std::uint8_t> (colour[2]), static_cast<std::uint8_t> (255 * alpha + 0.5f)};
  }

  /* How many steps away the first outside in a direction is; 0: none within reach. */
  [[nodiscard]] int trace (int x, int y, int right, int down, int reach) const
  {
    for (int r = 1; r <= reach; r++) {
      x += right;
      y += down;
      if (x < 0 || y < 0 || x >= covered_.width || y >= covered_.height)
        return 0;
      if (m_.sums_[place (x, y)] >> 24 >= kOutside)
        return r;
    }
    return 0;
  }

  /* Weighted mean of the farthest outsides in eight directions, and its share: all of it in gaps up
   * to half the reach wide, less in wider ones; nothing where a direction ends in none. */
  [[nodiscard]] Vec4 fill (int x, int y) const
  {
    constexpr float kSameSurface = 0.02f; /* metres */
    constexpr int kWays[8][2] = {
        {-1, -1}, {0, -1}, {1, -1}, {-1, 0}, {1, 0}, {-1, 1}, {0, 1}, {1, 1}};
    const int reach = fill_reach (picture_.part.height);
    int steps[8];
    std::size_t ends[8];
    float distances[8], farthest = 0;
    for (int k = 0; k < 8; k++) {
      steps[k] = trace (x, y, kWays[k][0], kWays[k][1], reach);
      if (steps[k] == 0)
        return Vec4{};
      ends[k] = place (x + steps[k] * kWays[k][0], y + steps[k] * kWays[k][1]);
      distances[k] = 1 / m_.nearness_[ends[k]];
      farthest = std::max (farthest, distances[k]);
    }
    int widest = 0;
    for (int k = 0; k < 4; k++)
      widest = std::max (widest, steps[k] + steps[7 - k]);
    const float share =
        std::clamp (2 - 2 * static_cast<float> (widest) / static_cast<float> (reach), 0.f, 1.f);
    Vec4 sum{};
    for (int k = 0; k < 8; k++)
      if (distances[k] > farthest - kSameSurface) {
        const bool diagonal = kWays[k][0] != 0 && kWays[k][1] != 0;
        const auto squared = static_cast<float> (steps[k] * steps[k] * (diagonal ? 2 : 1));
        const Rgbx c = sum_at (ends[k]);
        sum += Vec4{float (c.r), float (c.g), float (c.b), 1} / squared;
      }
    sum /= sum[3];
    sum[3] = share;
    return sum;
  }

  SoftwareRenderer &m_;
  const SurfacePicture &picture_;
  const std::span<const SurfaceLayer> layers_;
  const ImageView<Rgbx> &out_;
  const bool is_bgra_;
  const Roi &covered_;
  const std::size_t stride_;
  const bool mirrors_, is_points_;
  std::size_t cells_ = 1;
  float range_ = 0; /* of w, where both rays cross at right angles */
  std::array<ViewCotangent, kMaxBlendCells> cotangents_; /* by cell */
};

void
SoftwareRenderer::draw (const SurfacePicture &picture, std::span<const SurfaceLayer> layers,
    const ImageView<Rgbx> &out, bool is_bgra)
{
  Drawing (*this, picture, layers, out, is_bgra).draw ();
}

} // namespace rangecast
