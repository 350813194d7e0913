/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Milliseconds per picture of striprender's parts (strips made on the CPU, upload, drawing until
 * the GPU has finished) in every mode, beside a peer in the same run: a naive point cloud, one GL
 * point per valid pixel from a vertex buffer that the CPU unprojects into.
 * Four views, cut to the figure (or to that model), seen from 25 degrees beside the first camera in
 * 640x480; coded-strips are those of frame sets that went through the neighbour code with its
 * defaults. Holes: background pixels with something drawn within 5 pixels left and right and above
 * and below them, of all that is drawn or hole. --help lists the options. */
#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/scene/scene.hpp>
#include <string>
#include <vector>

#include "../../gst/strippainter.hpp"
#include "options.hpp"

using namespace rangecast;

namespace {

const char *const kUsage = "usage: render_bench [--rounds N] [--model FILE] [--pictures DIR]\n"
                           "  --rounds N      times are medians of so many (default 30)\n"
                           "  --model FILE    glTF or OBJ model (default: the built-in figure)\n"
                           "  --pictures DIR  writes what was drawn there, as PNG\n";

constexpr int kWidth = 640, kHeight = 480;

/* ---- what is drawn ---- */

struct FrameSet {
  Rig rig;
  std::vector<std::vector<std::uint16_t>> depth;
  std::vector<std::vector<Rgbx>> colour;
  std::vector<RangeImage> images; /* cut to the figure */
};

bool
make_frame_set (const SceneSettings &settings, FrameSet &set)
{
  std::unique_ptr<Scene> scene;
  Status status = Scene::create (settings, scene);
  if (status.ok ()) {
    set.rig = scene->range_rig ();
    const int w = settings.width, h = settings.height;
    set.depth.assign (set.rig.views.size (), std::vector<std::uint16_t> (w * h));
    set.colour.assign (set.rig.views.size (), std::vector<Rgbx> (w * h));
    for (std::size_t i = 0; i < set.rig.views.size (); i++)
      set.images.push_back ({set.rig.views[i].id, {0, 0, w, h}, {set.depth[i].data (), w, h, w * 2},
          {set.colour[i].data (), w, h, w * 4}, 0});
    std::vector<Roi> boxes (set.images.size ());
    status = scene->render_range (set.images, 0.5, false, boxes, 0);
    for (std::size_t i = 0; i < boxes.size (); i++) {
      const Roi &box = set.images[i].roi = boxes[i];
      set.images[i].depth = set.images[i].depth.crop (box.x, box.y, box.width, box.height);
      set.images[i].colour = set.images[i].colour.crop (box.x, box.y, box.width, box.height);
    }
  }
  if (!status.ok ())
    std::fprintf (stderr, "%s\n", status.message ().c_str ());
  return status.ok ();
}

/* What comes out of the neighbour code has runs of equal pixels. */
bool
code_and_decode (FrameSet &set)
{
  AccessUnitEncoder encoder;
  AccessUnitDecoder decoder;
  EncoderResult encoded;
  DecoderResult decoded;
  if (!encoder.configure (set.rig, {}).ok () || !decoder.set_rig (set.rig).ok () ||
      !encoder.encode (set.images, 1, 1, encoded).ok ())
    return false;
  const std::vector<std::uint8_t> bytes = encoder.bytes ();
  decoder.plan (bytes, decoded);
  return decoder.decode (set.images, 1, decoded).ok ();
}

StripPainter::Picture
make_picture (const FrameSet &set, StripMode mode)
{
  const SceneFrame frame = scene_frame (set.rig);
  Orbit orbit;
  orbit.azimuth_deg = 25;
  StripPainter::Picture picture = {};
  picture.clip_from_world =
      orbit_matrices (frame, orbit, double (kWidth) / kHeight, true).clip_from_world;
  picture.point_size = 1;
  picture.pixels_per_unit = float (kHeight / (2 * std::tan (frame.fov_deg * M_PI / 360)));
  picture.mode = mode;
  picture.depth_step = StripSettings{}.depth_step;
  picture.width = kWidth;
  picture.height = kHeight;
  return picture;
}

/* ---- the peer ---- */

const char *const kPointVertexShader = R"(
uniform mat4 u_clip_from_world;
uniform float u_point_size;
in vec3 a_position;
in vec4 a_colour;
out vec4 v_colour;
void main ()
{
  gl_Position = u_clip_from_world * vec4 (a_position, 1.0);
  gl_PointSize = max (1.0, u_point_size / gl_Position.w);
  v_colour = a_colour;
}
)";
const char *const kPointFragmentShader = R"(
precision highp float;
in vec4 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour.rgb, 1.0);
}
)";

/** One vertex buffer of x, y, z and colour for each view. */
class PointCloud {
public:
  bool start (GstGLContext *context, GError **error)
  {
    const bool gles = gst_gl_context_check_gl_version (context, GST_GL_API_GLES2, 3, 0);
    const auto version = gles ? GST_GLSL_VERSION_300 : GST_GLSL_VERSION_330;
    const auto profile = gles ? GST_GLSL_PROFILE_ES : GST_GLSL_PROFILE_CORE;
    const auto stage = [&] (guint type, const char *source) {
      const char *parts[] = {gles ? "#version 300 es\n" : "#version 330 core\n", source};
      return gst_glsl_stage_new_with_strings (context, type, version, profile, 2, parts);
    };
    gl_ = context->gl_vtable;
    gles_ = gles;
    shader_ = gst_gl_shader_new_link_with_stages (context, error,
        stage (GL_VERTEX_SHADER, kPointVertexShader),
        stage (GL_FRAGMENT_SHADER, kPointFragmentShader), nullptr);
    if (!shader_)
      return false;
    gl_->GenBuffers (1, &buffer_);
    gl_->GenVertexArrays (1, &array_);
    gl_->BindVertexArray (array_);
    gl_->BindBuffer (GL_ARRAY_BUFFER, buffer_);
    const auto attribute = [&] (const char *name, int n, guint type, gboolean scaled, gsize at) {
      const gint index = gst_gl_shader_get_attribute_location (shader_, name);
      gl_->EnableVertexAttribArray (guint (index));
      gl_->VertexAttribPointer (
          guint (index), n, type, scaled, sizeof (Point), reinterpret_cast<void *> (at));
    };
    attribute ("a_position", 3, GL_FLOAT, FALSE, 0);
    attribute ("a_colour", 4, GL_UNSIGNED_BYTE, TRUE, offsetof (Point, colour));
    return true;
  }

  void stop ()
  {
    gl_->DeleteBuffers (1, &buffer_);
    gl_->DeleteVertexArrays (1, &array_);
    gst_clear_object (&shader_);
  }

  /* As parallel as the strips are. */
  void build (const FrameSet &set)
  {
    points_.resize (set.images.size ());
    cv::parallel_for_ (cv::Range (0, int (set.images.size ())), [&] (const cv::Range &range) {
      for (int i = range.start; i < range.end; i++)
        unproject (set.images[i], *set.rig.find (set.images[i].view_id), points_[i]);
    });
  }

  guint64 draw (const FrameSet &set, const StripPainter::Picture &picture)
  {
    gl_->Viewport (0, 0, kWidth, kHeight);
    gl_->ClearColor (0, 0, 0, 0);
    gl_->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    gl_->Enable (GL_DEPTH_TEST);
    if (!gles_)
      gl_->Enable (0x8642); /* GL_PROGRAM_POINT_SIZE */
    gst_gl_shader_use (shader_);
    gst_gl_shader_set_uniform_matrix_4fv (
        shader_, "u_clip_from_world", 1, FALSE, picture.clip_from_world.data ());
    const double footprint = scene_frame (set.rig).distance_m / set.rig.views[0].intrinsics.fx;
    gst_gl_shader_set_uniform_1f (
        shader_, "u_point_size", float (footprint * picture.pixels_per_unit));
    gl_->BindVertexArray (array_);
    gl_->BindBuffer (GL_ARRAY_BUFFER, buffer_);
    guint64 bytes = 0;
    for (const auto &points : points_) {
      gl_->BufferData (
          GL_ARRAY_BUFFER, points.size () * sizeof (Point), points.data (), GL_STREAM_DRAW);
      gl_->DrawArrays (GL_POINTS, 0, GLsizei (points.size ()));
      bytes += points.size () * sizeof (Point);
    }
    gl_->BindVertexArray (0);
    return bytes;
  }

  [[nodiscard]] std::size_t size () const
  {
    std::size_t n = 0;
    for (const auto &points : points_)
      n += points.size ();
    return n;
  }

private:
  struct Point {
    float x, y, z;
    Rgbx colour;
  };

  static void unproject (const RangeImage &image, const View &view, std::vector<Point> &points)
  {
    points.clear ();
    for (int v = 0; v < image.roi.height; v++)
      for (int u = 0; u < image.roi.width; u++)
        if (const int d = image.depth.at (u, v)) {
          const Vec3 p = view.world_from_view * view.intrinsics.unproject (u + image.roi.x,
                                                    v + image.roi.y, d * view.depth_unit_m);
          points.push_back ({float (p.x), float (p.y), float (p.z), image.colour.at (u, v)});
        }
  }

  const GstGLFuncs *gl_ = nullptr;
  bool gles_ = false;
  GstGLShader *shader_ = nullptr;
  guint buffer_ = 0, array_ = 0;
  std::vector<std::vector<Point>> points_;
};

/* ---- measuring, in the GL thread ---- */

using Clock = std::chrono::steady_clock;

double
ms_since (Clock::time_point start)
{
  return std::chrono::duration<double, std::milli> (Clock::now () - start).count ();
}

double
median (std::vector<double> &values)
{
  std::nth_element (values.begin (), values.begin () + values.size () / 2, values.end ());
  return values[values.size () / 2];
}

/** One way to a picture: what the CPU prepares, what is then drawn, and counts of it. */
class Way {
public:
  virtual ~Way () = default;
  virtual void build () = 0;
  virtual guint64 draw () = 0; ///< @return bytes uploaded
  [[nodiscard]] virtual std::string counts () const = 0;
};

class StripWay : public Way {
public:
  StripWay (StripPainter &painter, const FrameSet &set, StripMode mode)
      : painter_ (painter), set_ (set), picture_ (make_picture (set, mode)),
        vertices_ (set.images.size ()), results_ (set.images.size ())
  {
    settings_.mode = mode;
  }

  void build () override
  {
    cv::parallel_for_ (cv::Range (0, int (vertices_.size ())), [&] (const cv::Range &range) {
      for (int i = range.start; i < range.end; i++) {
        results_[i] = {};
        build_strips (set_.images[i], settings_, vertices_[i], results_[i]);
      }
    });
  }

  guint64 draw () override
  {
    std::vector<StripPainter::Layer> layers;
    for (std::size_t i = 0; i < vertices_.size (); i++)
      layers.push_back ({set_.images[i], set_.rig.find (set_.images[i].view_id), vertices_[i]});
    return painter_.draw (picture_, layers);
  }

  [[nodiscard]] std::string counts () const override
  {
    std::size_t triangles = 0, vertices = 0;
    for (std::size_t i = 0; i < vertices_.size (); i++) {
      triangles += results_[i].triangles;
      vertices += vertices_[i].size ();
    }
    return std::to_string (triangles) + " triangles, " + std::to_string (vertices) + " vertices";
  }

private:
  StripPainter &painter_;
  const FrameSet &set_;
  const StripPainter::Picture picture_;
  StripSettings settings_;
  std::vector<std::vector<StripVertex>> vertices_;
  std::vector<StripResult> results_;
};

class PeerWay : public Way {
public:
  PeerWay (PointCloud &cloud, const FrameSet &set)
      : cloud_ (cloud), set_ (set), picture_ (make_picture (set, StripMode::kPoints))
  {
  }
  void build () override { cloud_.build (set_); }
  guint64 draw () override { return cloud_.draw (set_, picture_); }
  [[nodiscard]] std::string counts () const override
  {
    return "0 triangles, " + std::to_string (cloud_.size ()) + " vertices";
  }

private:
  PointCloud &cloud_;
  const FrameSet &set_;
  const StripPainter::Picture picture_;
};

double
holes_percent (const cv::Mat &rgba)
{
  cv::Mat alpha, drawn, beside, above, closed;
  cv::extractChannel (rgba, alpha, 3);
  drawn = alpha > 0;
  /* a background pixel that closing fills both along its row and along its column */
  cv::morphologyEx (drawn, beside, cv::MORPH_CLOSE, cv::Mat::ones (1, 11, CV_8U));
  cv::morphologyEx (drawn, above, cv::MORPH_CLOSE, cv::Mat::ones (11, 1, CV_8U));
  cv::bitwise_and (beside, above, closed);
  const int all = cv::countNonZero (closed);
  return all ? 100.0 * (all - cv::countNonZero (drawn & closed)) / all : 0;
}

struct Bench {
  GstGLContext *context = nullptr;
  GstGLMemory *target = nullptr;
  GstGLFramebuffer *framebuffer = nullptr;
  StripPainter painter;
  PointCloud cloud;
  int rounds = 30;
  std::string model, pictures;
  bool ok = false;
};

bool
start (Bench &bench)
{
  GError *error = nullptr;
  if (!bench.painter.start (bench.context, &error) || !bench.cloud.start (bench.context, &error)) {
    std::fprintf (stderr, "%s\n", error ? error->message : "no shader");
    return false;
  }
  GstVideoInfo info;
  gst_video_info_set_format (&info, GST_VIDEO_FORMAT_RGBA, kWidth, kHeight);
  auto params = reinterpret_cast<GstGLAllocationParams *> (gst_gl_video_allocation_params_new (
      bench.context, nullptr, &info, 0, nullptr, GST_GL_TEXTURE_TARGET_2D, GST_GL_RGBA));
  auto allocator =
      GST_GL_BASE_MEMORY_ALLOCATOR (gst_gl_memory_allocator_get_default (bench.context));
  bench.target = reinterpret_cast<GstGLMemory *> (gst_gl_base_memory_alloc (allocator, params));
  gst_gl_allocation_params_free (params);
  gst_object_unref (allocator);
  bench.framebuffer = gst_gl_framebuffer_new_with_default_depth (bench.context, kWidth, kHeight);
  return bench.target && bench.framebuffer;
}

void
stop (Bench &bench)
{
  bench.painter.stop ();
  bench.cloud.stop ();
  gst_clear_object (&bench.framebuffer);
  gst_memory_unref (GST_MEMORY_CAST (bench.target));
}

/* @return bytes uploaded; the GPU has finished */
guint64
draw_once (Bench &bench, Way &way)
{
  struct Job {
    Way &way;
    guint64 bytes;
  } job = {way, 0};
  GstMapInfo map; /* so that reading it back knows of the change */
  gst_memory_map (GST_MEMORY_CAST (bench.target), &map, GstMapFlags (GST_MAP_WRITE | GST_MAP_GL));
  gst_gl_framebuffer_draw_to_texture (
      bench.framebuffer, bench.target,
      +[] (gpointer data) -> gboolean {
        auto j = static_cast<Job *> (data);
        j->bytes = j->way.draw ();
        return TRUE;
      },
      &job);
  bench.context->gl_vtable->Finish ();
  gst_memory_unmap (GST_MEMORY_CAST (bench.target), &map);
  return job.bytes;
}

cv::Mat
read_back (Bench &bench)
{
  GstMapInfo map;
  gst_memory_map (GST_MEMORY_CAST (bench.target), &map, GST_MAP_READ);
  const cv::Mat rgba = cv::Mat (kHeight, kWidth, CV_8UC4, map.data).clone ();
  gst_memory_unmap (GST_MEMORY_CAST (bench.target), &map);
  return rgba;
}

struct Row {
  const char *name;
  Way &way;
  std::vector<double> build = {}, draw = {}, total = {}; /* ms */
};

void
time_once (Bench &bench, Row &row)
{
  const auto begin = Clock::now ();
  row.way.build ();
  row.build.push_back (ms_since (begin));
  draw_once (bench, row.way);
  row.total.push_back (ms_since (begin));
  row.draw.push_back (row.total.back () - row.build.back ());
}

void
report (Bench &bench, const std::string &size, Row &row)
{
  const guint64 bytes = draw_once (bench, row.way);
  const cv::Mat rgba = read_back (bench);
  std::printf ("%-14s %-12s %6.2f ms = CPU %5.2f + draw %6.2f  %s, %llu bytes, %.2f %% holes\n",
      size.c_str (), row.name, median (row.total), median (row.build), median (row.draw),
      row.way.counts ().c_str (), static_cast<unsigned long long> (bytes), holes_percent (rgba));
  if (bench.pictures.empty ())
    return;
  cv::Mat bgra;
  cv::cvtColor (rgba, bgra, cv::COLOR_RGBA2BGRA);
  cv::imwrite (bench.pictures + "/" + size.substr (4) + "-" + row.name + ".png", bgra);
}

/* In turns, so that whatever else the machine does hits all of them alike. */
void
measure (Bench &bench, const std::string &size, std::span<Row> rows)
{
  for (Row &row : rows) { /* the first time allocates */
    row.way.build ();
    draw_once (bench, row.way);
  }
  for (int i = 0; i < bench.rounds; i++)
    for (Row &row : rows)
      time_once (bench, row);
  for (Row &row : rows)
    report (bench, size, row);
}

void
run_in_gl_thread (GstGLContext *, gpointer data)
{
  auto &bench = *static_cast<Bench *> (data);
  if (!start (bench))
    return;
  bench.ok = true;
  for (int width : {320, 640}) {
    SceneSettings settings;
    settings.width = width;
    settings.height = width * 3 / 4;
    settings.model = bench.model;
    FrameSet set, coded;
    if (!make_frame_set (settings, set) || !make_frame_set (settings, coded) ||
        !code_and_decode (coded)) {
      bench.ok = false;
      break;
    }
    const std::string size = "4 x " + std::to_string (width) + "x" + std::to_string (width * 3 / 4);
    StripWay strips (bench.painter, set, StripMode::kStrips);
    StripWay coded_strips (bench.painter, coded, StripMode::kStrips);
    StripWay rectangles (bench.painter, set, StripMode::kRectangles);
    StripWay points (bench.painter, set, StripMode::kPoints);
    PeerWay peer (bench.cloud, set);
    Row rows[] = {{"strips", strips}, {"coded-strips", coded_strips}, {"rectangles", rectangles},
        {"points", points}, {"point-cloud", peer}};
    measure (bench, size, rows);
  }
  stop (bench);
}

} // namespace

int
main (int argc, char **argv)
{
  gst_init (nullptr, nullptr);
  Bench bench;
  Options options ("render_bench", kUsage);
  options.number ("--rounds", bench.rounds, 1, 100000);
  options.text ("--model", bench.model);
  options.text ("--pictures", bench.pictures);
  if (const auto status = options.parse (argc, argv))
    return *status;
  GstGLDisplay *display = gst_gl_display_new ();
  bench.context = gst_gl_context_new (display);
  GError *error = nullptr;
  if (!gst_gl_context_create (bench.context, nullptr, &error)) {
    std::fprintf (stderr, "%s\n", error->message);
    return 1;
  }
  gst_gl_memory_init_once ();
  gst_gl_context_thread_add (bench.context, run_in_gl_thread, &bench);
  gst_object_unref (bench.context);
  gst_object_unref (display);
  return bench.ok ? 0 : 1;
}
