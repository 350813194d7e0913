/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "shaders.hpp"

namespace rangecast {
namespace {

/* `vec4 background (vec2 at)`, the background's colour at that pixel of the framebuffer; first in a
 * fragment shader. A gradient in 8 bits shows bands; noise of one level hides them: interleaved
 * gradient noise (J. Jimenez, "Next generation post processing in Call of Duty", SIGGRAPH 2014). */
const char *const kBackgroundFunction = R"(
precision highp float;
uniform vec4 u_background;
uniform vec3 u_shade; /* first row, rows, share by which the first is lighter */
vec4 background (vec2 at)
{
  if (u_shade.z == 0.0)
    return u_background;
  float down = (at.y - u_shade.x) / u_shade.y;
  float noise = fract (52.9829189 * fract (dot (at, vec2 (0.06711056, 0.00583715)))) - 0.5;
  return vec4 (u_background.rgb * (1.0 + u_shade.z * (1.0 - 2.0 * down)) + noise / 255.0, u_background.a);
}
)";

const char *const kBackgroundFragment = R"(
out vec4 fragment;
void main ()
{
  fragment = background (gl_FragCoord.xy);
}
)";

const char *const kCoveringVertex = R"(
uniform float u_covering_depth;
void main ()
{
  gl_Position = vec4 (gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, u_covering_depth, 1.0);
}
)";

const char *const kColourFragment = R"(
precision highp float;
in vec3 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour, 1.0);
}
)";

/* `vec4 clip_position (vec2 at, float depth)` of a view's pixel `at` (column, row of the ROI),
 * moved away from the viewer. */
const char *const kClipPosition = R"(
precision highp float;
uniform mat4 u_clip_from_pixel; /* column, row and 1, all times depth, and 1 */
uniform vec2 u_behind;
vec4 clip_position (vec2 at, float depth)
{
  vec4 position = u_clip_from_pixel * vec4 (at * depth, depth, 1.0);
  /* the depth of what is u_behind.y metres farther, in the same place of the picture */
  position.z -= u_behind.x / (max (position.w, 0.0) + u_behind.y);
  return position;
}
)";

/* A vertex is the number of its pixel, whose depth and colour are fetched here. Vertices beside
 * their pixel follow the surface of it and its neighbours. */
const char *const kStripVertex = R"(
precision highp int;
precision highp usampler2D;
uniform usampler2D u_depth;
uniform sampler2D u_colour;
uniform ivec2 u_size; /* of the ROI; beyond it the textures hold older frames */
uniform float u_focal; /* pixels */
uniform float u_unit;
uniform float u_step;
uniform float u_point_size;
layout (location = 0) in uint a_vertex;
out vec3 v_colour;

#if WITH_OFFSETS
/* The growth of depth from the neighbour before `p`, if that is on the same surface. */
bool has_rise (ivec2 p, ivec2 way, float depth, out float rise)
{
  ivec2 from = clamp (p - way, ivec2 (0), u_size - 1);
  float before = float (texelFetch (u_depth, from, 0).r);
  rise = depth - before;
  return from != p && before > 0.0 && abs (rise) <= u_step * depth;
}
/* Surfaces are extended beyond their edges at 45 degrees at most: where they are seen at a grazing
 * angle, depth rises too fast to be trusted, and the extensions would be spikes. */
const float kMaxSlope = 1.0;
float slope (ivec2 p, ivec2 way, float offset, float depth)
{
  float limit = kMaxSlope * depth / u_focal, rise;
#if BOTH_SIDES
  float fall;
  bool has_before = has_rise (p, way, depth, rise), has_after = has_rise (p, -way, depth, fall);
  if (has_before && has_after)
    return (rise - fall) * 0.5;
  return clamp (has_before ? rise : has_after ? -fall : 0.0, -limit, limit);
#else
  int outward = offset > 0.0 ? 1 : -1;
  return has_rise (p, outward * way, depth, rise) ? clamp (float (outward) * rise, -limit, limit) : 0.0;
#endif
}
#endif

void main ()
{
  ivec2 pixel = ivec2 (int (a_vertex & 8191u), int (a_vertex >> 13u & 8191u));
  vec2 at = vec2 (pixel);
  float depth = float (texelFetch (u_depth, pixel, 0).r);
#if WITH_OFFSETS
  ivec2 place = ivec2 (int (a_vertex >> 26u & 7u), int (a_vertex >> 29u));
  vec2 offset = vec2 (place - 3) * 0.25;
  at += offset;
  if (offset.x != 0.0)
    depth += offset.x * slope (pixel, ivec2 (1, 0), offset.x, depth);
  if (offset.y != 0.0)
    depth += offset.y * slope (pixel, ivec2 (0, 1), offset.y, depth);
#endif
  gl_Position = clip_position (at, depth);
  gl_PointSize = max (1.0, u_point_size * depth * u_unit / (u_focal * gl_Position.w));
  v_colour = texelFetch (u_colour, pixel, 0).rgb;
}
)";

/* ---- mode kBlend ---- */

const char *const kBlendVertex = R"(
layout (location = 0) in vec2 a_place; /* quarters of a pixel */
layout (location = 1) in float a_depth;
invariant gl_Position; /* in both passes */
#if SUM
uniform float u_unit;
uniform vec4 u_lens; /* principal point in the ROI, 1 / focal lengths; pixels */
uniform vec3 u_viewer; /* in the view's camera coordinates, metres */
layout (location = 2) in vec4 a_colour; /* and the square root of the weight */
out vec4 v_colour;
const float kMinAngle = 0.03; /* square root of the minimum weight; the cosine's power is 6 */
#endif
void main ()
{
  vec2 at = 0.25 * a_place;
  gl_Position = clip_position (at, a_depth);
#if SUM
  vec3 ray = vec3 ((at - u_lens.xy) * u_lens.zw, 1.0);
  float along = dot (normalize (ray), normalize (ray * a_depth * u_unit - u_viewer));
  v_colour = vec4 (a_colour.rgb, a_colour.a * max (along * along * along, kMinAngle));
#endif
}
)";

const char *const kBlendFragment = R"(
precision highp float;
#if SUM
in vec4 v_colour;
uniform vec3 u_weights; /* maximum, minimum, inside */
out vec4 sum;
#endif
void main ()
{
#if SUM
  float weight = gl_FrontFacing ? max (v_colour.a * v_colour.a * u_weights.x, u_weights.y) : u_weights.z;
  sum = vec4 (v_colour.rgb * weight, weight);
#endif
}
)";

/* Outlines are smoothed over the four neighbours, which also closes cracks of one pixel between
 * what two views draw. Where no camera saw the outside of a surface, so that the inside of one
 * behind shows through (beside a nose, round glasses), small gaps take the colours around them,
 * from the farther surfaces: what a nearer one hides is theirs. */
const char *const kDivideFragment = R"(
precision highp int;
precision highp sampler2D;
uniform sampler2D u_sum; /* R, G, B times weight; weight */
uniform sampler2D u_depth;
uniform vec3 u_shift; /* a, b, g of DepthShift */
uniform ivec4 u_part; /* first and last pixel */
uniform float u_outside; /* minimum weight of an outside, less rounding */
uniform int u_reach; /* pixels: wider gaps are not filled */
out vec4 fragment;
float distance_at (ivec2 at)
{
  return u_shift.y / (2.0 * texelFetch (u_depth, at, 0).r - 1.0 - u_shift.x) - u_shift.z;
}
/* The first outside in a direction, and how many steps away; 0: none within reach. */
int trace (ivec2 at, ivec2 step, out vec4 outside)
{
  outside = vec4 (0.0);
  int last = 0;
  for (int r = 1; r <= u_reach; r += 1 + r / 4) {
    outside = texelFetch (u_sum, clamp (at + r * step, u_part.xy, u_part.zw), 0);
    if (outside.a >= u_outside) {
      for (int back = r - 1; back > last; back--) { /* the strides grow */
        vec4 nearer = texelFetch (u_sum, clamp (at + back * step, u_part.xy, u_part.zw), 0);
        if (nearer.a < u_outside)
          break;
        outside = nearer;
        r = back;
      }
      return r;
    }
    last = r;
  }
  return 0;
}
ivec2 direction (int k) /* 0 to 7; k and 7 - k are opposite */
{
  int q = k < 4 ? k : k + 1; /* of 3 x 3, without the centre */
  return ivec2 (q % 3 - 1, q / 3 - 1);
}
/* Weighted mean of the farthest outsides in eight directions, and its share: all of it in gaps up to
 * half the reach wide, less in wider ones; nothing where a direction ends in none. */
vec4 fill (ivec2 at)
{
  const float kSameSurface = 0.02; /* metres */
  vec4 outside;
  float farthest = 0.0;
  int widest = 0;
  for (int k = 0; k < 4; k++) {
    int there = trace (at, direction (k), outside), opposite = trace (at, direction (7 - k), outside);
    if (there == 0 || opposite == 0)
      return vec4 (0.0);
    widest = max (widest, there + opposite);
    farthest = max (farthest, max (distance_at (at + there * direction (k)),
                                  distance_at (at + opposite * direction (7 - k))));
  }
  float share = clamp (2.0 - 2.0 * float (widest) / float (u_reach), 0.0, 1.0);
  if (share <= 0.0)
    return vec4 (0.0);
  vec4 sum = vec4 (0.0);
  for (int k = 0; k < 8; k++) {
    ivec2 way = trace (at, direction (k), outside) * direction (k);
    if (distance_at (at + way) > farthest - kSameSurface)
      sum += vec4 (outside.rgb / outside.a, 1.0) / float (way.x * way.x + way.y * way.y);
  }
  return vec4 (sum.rgb / sum.a, share);
}
void main ()
{
  vec4 ground = background (gl_FragCoord.xy);
  ivec2 at = ivec2 (gl_FragCoord.xy), first = u_part.xy, last = u_part.zw;
  vec4 sum = texelFetch (u_sum, at, 0);
  vec4 west = texelFetch (u_sum, ivec2 (max (at.x - 1, first.x), at.y), 0);
  vec4 east = texelFetch (u_sum, ivec2 (min (at.x + 1, last.x), at.y), 0);
  vec4 north = texelFetch (u_sum, ivec2 (at.x, max (at.y - 1, first.y)), 0);
  vec4 south = texelFetch (u_sum, ivec2 (at.x, min (at.y + 1, last.y)), 0);
  vec4 weights = vec4 (west.a, east.a, north.a, south.a);
  float covered = dot (vec4 (greaterThan (weights, vec4 (0.0))), vec4 (1.0));
  /* a pixel that is drawn: from 1/2 where none beside it is; one that is not: up to 1/2, or a crack */
  float coverage = sum.a > 0.0 ? 0.5 + 0.125 * covered : covered > 2.0 ? 1.0 : 0.125 * covered;
  float heaviest = sum.a;
  if (sum.a <= 0.0) {
    sum = west + east + north + south;
    heaviest = max (max (west.a, east.a), max (north.a, south.a));
  }
  if (heaviest > 0.0 && heaviest < u_outside) {
    vec4 filled = fill (at);
    sum = vec4 (mix (sum.rgb / sum.a, filled.rgb, filled.a), 1.0);
  }
#if WITH_DEPTH
  float depth = texelFetch (u_depth, at, 0).r, distance = distance_at (at);
  gl_FragDepth = depth < 1.0 ? 0.5 + 0.5 * (u_shift.x + u_shift.y / distance) : 1.0;
#endif
  float behind = (1.0 - coverage) * ground.a;
  float alpha = coverage + behind;
  vec3 colour = coverage * sum.rgb / max (sum.a, 1e-7) + behind * ground.rgb;
  fragment = alpha > 0.0 ? vec4 (colour / alpha, alpha) : ground;
}
)";

/* Strips extend beyond their ends, away from them; rectangles on all four sides; points do not. */
std::string
strip_vertex_shader (bool with_offsets, bool both_sides)
{
  return "#define WITH_OFFSETS " + std::to_string (with_offsets) + "\n#define BOTH_SIDES " +
         std::to_string (both_sides) + "\n" + kClipPosition + kStripVertex;
}

} // namespace

std::string
shader_source (Shader shader)
{
  const std::string depth_pass = "#define SUM 0", sum_pass = "#define SUM 1";
  switch (shader) {
    case Shader::kCoveringVertex:
      return kCoveringVertex;
    case Shader::kColourFragment:
      return kColourFragment;
    case Shader::kBackgroundFragment:
      return std::string (kBackgroundFunction) + kBackgroundFragment;
    case Shader::kStripVertex:
      return strip_vertex_shader (true, false);
    case Shader::kRectangleVertex:
      return strip_vertex_shader (true, true);
    case Shader::kPointVertex:
      return strip_vertex_shader (false, false);
    case Shader::kBlendDepthVertex:
      return depth_pass + kClipPosition + kBlendVertex;
    case Shader::kBlendDepthFragment:
      return depth_pass + kBlendFragment;
    case Shader::kBlendSumVertex:
      return sum_pass + kClipPosition + kBlendVertex;
    case Shader::kBlendSumFragment:
      return sum_pass + kBlendFragment;
    case Shader::kDivideFragment:
      return std::string ("#define WITH_DEPTH 0") + kBackgroundFunction + kDivideFragment;
    case Shader::kDivideDepthFragment:
      return std::string ("#define WITH_DEPTH 1") + kBackgroundFunction + kDivideFragment;
  }
  return {};
}

} // namespace rangecast
