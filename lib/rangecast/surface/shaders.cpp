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

const char *const kCoveringVertex = R"(
void main ()
{
  gl_Position = vec4 (gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
)";

/* Fourth roots of weights, from 0 to 1, fit into 8 bits. The inside of a surface weighs so little
 * that a sum tells a pixel in which all views show an inside from one in which a view shows an
 * outside. */
const char *const kBlendWeights = R"(
precision highp float;
const float kInside = 1.0 / 255.0, kMinOutside = 10.0 / 255.0;
float weight_of (float root)
{
  return root * root * root * root;
}
)";

const char *const kVertex = R"(
uniform mat4 u_clip_from_pixel; /* column, row and 1, all times depth, and 1 */
uniform vec2 u_behind; /* moves away from the viewer */
uniform float u_point_size; /* at a depth of 1 depth unit and a distance of 1, pixels */
layout (location = 0) in vec2 a_place; /* quarters of a pixel */
layout (location = 1) in float a_depth;
layout (location = 2) in vec4 a_colour; /* and the square root of the weight */
uniform float u_unit;
uniform vec4 u_lens; /* principal point in the ROI, 1 / focal lengths; pixels */
uniform vec3 u_viewer; /* in the view's camera coordinates, metres */
out vec4 v_colour;
const float kMinAngle = 0.03; /* square root of the minimum weight; the cosine's power is 6 */
void main ()
{
  vec2 at = 0.25 * a_place;
  gl_Position = u_clip_from_pixel * vec4 (at * a_depth, a_depth, 1.0);
  /* the depth of what is u_behind.y metres farther, in the same place of the picture */
  gl_Position.z -= u_behind.x / (max (gl_Position.w, 0.0) + u_behind.y);
  gl_PointSize = max (1.0, u_point_size * a_depth / gl_Position.w);
  vec3 ray = vec3 ((at - u_lens.xy) * u_lens.zw, 1.0);
  float along = dot (normalize (ray), normalize (ray * a_depth * u_unit - u_viewer));
  float root = a_colour.a * max (along * along * along, kMinAngle);
  v_colour = vec4 (a_colour.rgb, max (sqrt (root), kMinOutside));
}
)";

const char *const kFragment = R"(
in vec4 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour.rgb, gl_FrontFacing ? v_colour.a : kInside);
}
)";

/* Adds up, of each pixel, the colours of all cells that are within the blend range. */
const char *const kSumFragment = R"(
precision highp int;
precision highp sampler2D;
uniform sampler2D u_colours;
uniform sampler2D u_depths;
uniform ivec2 u_cells[CELLS]; /* from a pixel of the picture to that of a cell */
uniform vec2 u_cotangents[CELLS]; /* per_w, offset of ViewCotangent */
uniform vec3 u_shift; /* a, b, g of DepthShift */
out vec4 fragment; /* and the fourth root of the mean weight */
void main ()
{
  ivec2 at = ivec2 (gl_FragCoord.xy);
  float depths[CELLS], nearest = 1.0;
  for (int i = 0; i < CELLS; i++) { /* without loops at run time, which cost software a multiple */
    depths[i] = texelFetch (u_depths, at + u_cells[i], 0).r;
    nearest = min (nearest, depths[i]);
  }
  float distance = u_shift.y / (2.0 * nearest - 1.0 - u_shift.x);
  vec4 sum = vec4 (0.0);
  for (int i = 0; i < CELLS; i++) {
    float cotangent = max (u_cotangents[i].x * distance - u_cotangents[i].y, 0.0);
    float farthest = distance + u_shift.z * sqrt (1.0 + cotangent * cotangent);
    if (depths[i] < 1.0 && depths[i] <= 0.5 + 0.5 * (u_shift.x + u_shift.y / farthest)) {
      vec4 texel = texelFetch (u_colours, at + u_cells[i], 0);
      sum += weight_of (texel.a) * vec4 (texel.rgb, 1.0);
    }
  }
  float root = sqrt (sqrt (sum.a / float (CELLS)));
  fragment = sum.a > 0.0 ? vec4 (sum.rgb / sum.a, max (root, kInside)) : vec4 (0.0);
  gl_FragDepth = nearest;
}
)";

/* Outlines are smoothed over the four neighbours, which also closes cracks of one pixel between
 * what two views draw. Where no camera saw the outside of a surface, so that the inside of one
 * behind shows through (beside a nose, round glasses), small gaps take the colours around them,
 * from the farther surfaces: what a nearer one hides is theirs. */
const char *const kFinishFragment = R"(
precision highp int;
precision highp sampler2D;
uniform sampler2D u_sum; /* colours, fourth roots of weights */
uniform sampler2D u_depths;
uniform vec3 u_shift; /* a, b, g of DepthShift */
uniform ivec4 u_part; /* first and last pixel */
uniform int u_reach; /* pixels: wider gaps are not filled */
uniform bool u_smooth; /* false: pixels are as they were drawn */
out vec4 fragment;
/* Minimum of an outside of which no cell but one of eight has anything, less rounding. */
const float kOutside = 0.5 * kMinOutside;
/* Nothing is drawn outside of the part; what textures hold there is of other pictures. */
ivec2 within (ivec2 at)
{
  return clamp (at, u_part.xy, u_part.zw);
}
float distance_at (ivec2 at)
{
  return u_shift.y / (2.0 * texelFetch (u_depths, within (at), 0).r - 1.0 - u_shift.x);
}
/* How many steps away the first outside in a direction is; 0: none within reach. */
int trace (ivec2 at, ivec2 step)
{
  for (int r = 1; r <= u_reach; r++)
    if (texelFetch (u_sum, within (at + r * step), 0).a >= kOutside)
      return r;
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
  ivec4 there, opposite;
  float farthest = 0.0;
  int widest = 0;
  for (int k = 0; k < 4; k++) {
    there[k] = trace (at, direction (k));
    opposite[k] = trace (at, direction (7 - k));
    if (there[k] == 0 || opposite[k] == 0)
      return vec4 (0.0);
    widest = max (widest, there[k] + opposite[k]);
    farthest = max (farthest, max (distance_at (at + there[k] * direction (k)),
                                  distance_at (at + opposite[k] * direction (7 - k))));
  }
  float share = clamp (2.0 - 2.0 * float (widest) / float (u_reach), 0.0, 1.0);
  if (share <= 0.0)
    return vec4 (0.0);
  vec4 sum = vec4 (0.0);
  for (int k = 0; k < 8; k++) {
    ivec2 way = (k < 4 ? there[k] : opposite[7 - k]) * direction (k);
    if (distance_at (at + way) > farthest - kSameSurface)
      sum += vec4 (texelFetch (u_sum, within (at + way), 0).rgb, 1.0) / float (way.x * way.x + way.y * way.y);
  }
  return vec4 (sum.rgb / sum.a, share);
}
/* Colour times weight, and weight. */
vec4 weighted (ivec2 at)
{
  vec4 texel = texelFetch (u_sum, within (at), 0);
  float weight = weight_of (texel.a);
  return vec4 (texel.rgb * weight, weight);
}
void main ()
{
  vec4 ground = background (gl_FragCoord.xy);
  ivec2 at = ivec2 (gl_FragCoord.xy);
  vec4 sum = weighted (at);
  vec4 west = weighted (at - ivec2 (1, 0)), east = weighted (at + ivec2 (1, 0));
  vec4 north = weighted (at - ivec2 (0, 1)), south = weighted (at + ivec2 (0, 1));
  vec4 weights = vec4 (west.a, east.a, north.a, south.a);
  float covered = dot (vec4 (greaterThan (weights, vec4 (0.0))), vec4 (1.0));
  /* a pixel that is drawn: from 1/2 where none beside it is; one that is not: up to 1/2, or a crack */
  float coverage = sum.a > 0.0 ? 0.5 + 0.125 * covered : covered > 2.0 ? 1.0 : 0.125 * covered;
  if (!u_smooth)
    coverage = sum.a > 0.0 ? 1.0 : 0.0;
  float heaviest = sum.a;
  if (sum.a <= 0.0) {
    sum = west + east + north + south;
    heaviest = max (max (west.a, east.a), max (north.a, south.a));
  }
  bool is_gap = heaviest > 0.0 && heaviest < weight_of (kOutside);
  if (is_gap) {
    vec4 filled = fill (at);
    sum = vec4 (mix (sum.rgb / sum.a, filled.rgb, filled.a), 1.0);
  }
  float behind = (1.0 - coverage) * ground.a;
  float alpha = coverage + behind;
  vec3 colour = coverage * sum.rgb / max (sum.a, 1e-15) + behind * ground.rgb;
  fragment = alpha > 0.0 ? vec4 (colour / alpha, alpha) : ground;
}
)";

} // namespace

std::string
shader_source (Shader shader)
{
  switch (shader) {
    case Shader::kCoveringVertex:
      return kCoveringVertex;
    case Shader::kVertex:
      return std::string (kBlendWeights) + kVertex;
    case Shader::kFragment:
      return std::string (kBlendWeights) + kFragment;
    case Shader::kFinishFragment:
      return std::string (kBackgroundFunction) + kBlendWeights + kFinishFragment;
    case Shader::kSumFragment:
      break;
  }
  const int cells = static_cast<int> (shader) - static_cast<int> (Shader::kSumFragment) + 1;
  return "#define CELLS " + std::to_string (cells) + kBlendWeights + kSumFragment;
}

} // namespace rangecast
