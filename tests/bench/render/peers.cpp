/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <cstddef>
#include <rangecast/base/parallel.hpp>
#include <rangecast/surface/orbit.hpp>

#include "ways.hpp"

using namespace rangecast;

namespace bench {
namespace {

const char *const kVertexShader = R"(
precision highp float;
uniform mat4 u_clip_from_world;
uniform float u_point_size;
in vec3 a_position;
in vec4 a_colour;
out vec3 v_colour;
void main ()
{
  gl_Position = u_clip_from_world * vec4 (a_position, 1.0);
  gl_PointSize = max (1.0, u_point_size / gl_Position.w);
  v_colour = a_colour.rgb;
}
)";

const char *const kFragmentShader = R"(
precision highp float;
in vec3 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour, 1.0);
}
)";

struct Point {
  float x, y, z;
  Rgbx colour;
};

/** Of one view. */
struct Part {
  std::vector<Point> points;
  std::vector<guint32> corners; /* of triangles */
  std::vector<guint32> number;  /* of each pixel's point */
};

class PeerWay : public Way {
public:
  PeerWay (std::string name, Peer peer, const FrameSet &set)
      : Way (std::move (name)), peer_ (peer), set_ (set), parts_ (set.images.size ())
  {
  }
  ~PeerWay () override
  {
    if (!gl_)
      return;
    gl_->DeleteBuffers (2, buffers_);
    gl_->DeleteVertexArrays (1, &array_);
    gst_clear_object (&shader_);
  }

  bool start (GstGLContext *context, GError **error)
  {
    shader_ = make_shader (context, kVertexShader, kFragmentShader, error);
    if (!shader_)
      return false;
    gl_ = context->gl_vtable;
    gles_ = is_gles (context);
    gl_->GenBuffers (2, buffers_);
    gl_->GenVertexArrays (1, &array_);
    gl_->BindVertexArray (array_);
    gl_->BindBuffer (GL_ARRAY_BUFFER, buffers_[0]);
    gl_->BindBuffer (GL_ELEMENT_ARRAY_BUFFER, buffers_[1]);
    const auto attribute = [&] (const char *name, int n, guint type, gboolean scaled, gsize at) {
      const gint index = gst_gl_shader_get_attribute_location (shader_, name);
      gl_->EnableVertexAttribArray (guint (index));
      gl_->VertexAttribPointer (guint (index), n, type, scaled, sizeof (Point),
          reinterpret_cast<void *> (at)); /* NOLINT: an offset, as OpenGL wants it */
    };
    attribute ("a_position", 3, GL_FLOAT, FALSE, 0);
    attribute ("a_colour", 4, GL_UNSIGNED_BYTE, TRUE, offsetof (Point, colour));
    gl_->BindVertexArray (0);
    return true;
  }

  void build (const Orbit &) override /* as parallel as the strips are */
  {
    in_parallel (parts_.size (), 0, [&] (std::size_t i) {
      unproject (set_.images[i], *set_.rig.find (set_.images[i].view_id), parts_[i]);
      if (peer_ == Peer::kGrid)
        join (set_.images[i], parts_[i]);
    });
  }

  guint64 draw (const SurfacePicture &picture) override
  {
    begin (picture);
    guint64 bytes = 0;
    for (const Part &part : parts_) {
      bytes += load (GL_ARRAY_BUFFER, part.points);
      if (peer_ == Peer::kPoints) {
        gl_->DrawArrays (GL_POINTS, 0, GLsizei (part.points.size ()));
        continue;
      }
      bytes += load (GL_ELEMENT_ARRAY_BUFFER, part.corners);
      gl_->DrawElements (GL_TRIANGLES, GLsizei (part.corners.size ()), GL_UNSIGNED_INT, nullptr);
    }
    gl_->BindVertexArray (0);
    gl_->Disable (GL_DEPTH_TEST);
    return bytes;
  }

  [[nodiscard]] std::size_t vertices () const override
  {
    std::size_t n = 0;
    for (const Part &part : parts_)
      n += part.points.size ();
    return n;
  }
  [[nodiscard]] std::size_t triangles () const override
  {
    std::size_t n = 0;
    for (const Part &part : parts_)
      n += part.corners.size () / 3;
    return n;
  }

private:
  void begin (const SurfacePicture &picture)
  {
    gl_->Viewport (0, 0, picture.width, picture.height);
    gl_->ClearColor (0, 0, 0, 0);
    gl_->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    gl_->Enable (GL_DEPTH_TEST);
    if (!gles_)
      gl_->Enable (0x8642); /* GL_PROGRAM_POINT_SIZE */
    gst_gl_shader_use (shader_);
    gst_gl_shader_set_uniform_matrix_4fv (
        shader_, "u_clip_from_world", 1, FALSE, picture.clip_from_world.data ());
    const double footprint = scene_frame (set_.rig).distance_m / set_.rig.views[0].intrinsics.fx;
    gst_gl_shader_set_uniform_1f (
        shader_, "u_point_size", float (footprint * picture.pixels_per_unit));
    gl_->BindVertexArray (array_);
    gl_->BindBuffer (GL_ARRAY_BUFFER, buffers_[0]);
  }

  template <typename T> guint64 load (guint target, const std::vector<T> &what)
  {
    gl_->BufferData (target, gsize (what.size () * sizeof (T)), what.data (), GL_STREAM_DRAW);
    return what.size () * sizeof (T);
  }

  static void unproject (const RangeImage &image, const View &view, Part &part)
  {
    part.points.clear ();
    part.number.resize (static_cast<std::size_t> (image.roi.width * image.roi.height));
    for (int v = 0; v < image.roi.height; v++)
      for (int u = 0; u < image.roi.width; u++)
        if (const int d = image.depth.at (u, v)) {
          part.number[static_cast<std::size_t> (v * image.roi.width + u)] =
              guint32 (part.points.size ());
          const Vec3 p = view.world_from_view * view.intrinsics.unproject (u + image.roi.x,
                                                    v + image.roi.y, d * view.depth_unit_m);
          part.points.push_back ({float (p.x), float (p.y), float (p.z), image.colour.at (u, v)});
        }
  }

  static void join (const RangeImage &image, Part &part)
  {
    const int width = image.roi.width;
    part.corners.clear ();
    for (int v = 0; v + 1 < image.roi.height; v++)
      for (int u = 0; u + 1 < width; u++) {
        const std::uint16_t *row = image.depth.row (v) + u, *next = image.depth.row (v + 1) + u;
        const auto [least, most] = std::minmax ({row[0], row[1], next[0], next[1]});
        if (least == kInvalidDepth || most - least > least * StripSettings{}.depth_step)
          continue;
        const guint32 *n = part.number.data () + v * width + u, *m = n + width;
        for (const guint32 corner : {n[0], m[0], n[1], n[1], m[0], m[1]})
          part.corners.push_back (corner);
      }
  }

  const Peer peer_;
  const FrameSet &set_;
  std::vector<Part> parts_;
  const GstGLFuncs *gl_ = nullptr;
  bool gles_ = false;
  GstGLShader *shader_ = nullptr;
  guint buffers_[2] = {}, array_ = 0;
};

} // namespace

std::unique_ptr<Way>
make_peer (std::string name, Peer peer, GstGLContext *context, const FrameSet &set, GError **error)
{
  auto way = std::make_unique<PeerWay> (std::move (name), peer, set);
  if (!way->start (context, error))
    return nullptr;
  return way;
}

} // namespace bench
