/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* In the steady state striprender neither reads back from OpenGL nor waits for it, and creates,
 * reallocates and compiles nothing. Vertices and pixels go into existing objects, of which there
 * are two sets in turn: a GPU may still draw from the other one. */
#include <gst/gl/gstglfuncs.h>

#include <atomic>
#include <map>
#include <type_traits>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

using Counts = std::map<std::string, int>;

/* Counts the calls of one function of a context's table and passes them on. The table is shared by
 * all elements that draw in this context. */
template <auto Function,
    class Type = std::remove_reference_t<decltype (std::declval<GstGLFuncs &> ().*Function)>>
class CallCounter;

template <auto Function, class Result, class... Arguments>
class CallCounter<Function, Result (*) (Arguments...)> {
public:
  static void install (GstGLFuncs &gl)
  {
    calls_ = 0;
    function_ = gl.*Function;
    if (function_)
      gl.*Function = call;
  }
  static int remove (GstGLFuncs &gl)
  {
    gl.*Function = function_;
    return calls_;
  }

private:
  static Result call (Arguments... arguments)
  {
    calls_++;
    return function_ (arguments...);
  }
  static inline Result (*function_) (Arguments...) = nullptr;
  static inline std::atomic<int> calls_ = 0;
};

struct CountedFunction {
  const char *name;
  void (*install) (GstGLFuncs &gl);
  int (*remove) (GstGLFuncs &gl);
};

template <auto Function>
constexpr CountedFunction
counted (const char *name)
{
  return {name, CallCounter<Function>::install, CallCounter<Function>::remove};
}

/* What a frame set must not cost. */
static const CountedFunction kForbidden[] = {
    counted<&GstGLFuncs::ReadPixels> ("ReadPixels"),
    counted<&GstGLFuncs::Finish> ("Finish"),
    counted<&GstGLFuncs::GetTexImage> ("GetTexImage"),
    counted<&GstGLFuncs::MapBuffer> ("MapBuffer"),
    counted<&GstGLFuncs::MapBufferRange> ("MapBufferRange"),
    counted<&GstGLFuncs::ClientWaitSync> ("ClientWaitSync"),
    counted<&GstGLFuncs::BufferData> ("BufferData"),
    counted<&GstGLFuncs::TexImage2D> ("TexImage2D"),
    counted<&GstGLFuncs::RenderbufferStorage> ("RenderbufferStorage"),
    counted<&GstGLFuncs::GenBuffers> ("GenBuffers"),
    counted<&GstGLFuncs::GenTextures> ("GenTextures"),
    counted<&GstGLFuncs::GenFramebuffers> ("GenFramebuffers"),
    counted<&GstGLFuncs::GenRenderbuffers> ("GenRenderbuffers"),
    counted<&GstGLFuncs::GenVertexArrays> ("GenVertexArrays"),
    counted<&GstGLFuncs::CreateShader> ("CreateShader"),
    counted<&GstGLFuncs::CompileShader> ("CompileShader"),
    counted<&GstGLFuncs::CreateProgram> ("CreateProgram"),
    counted<&GstGLFuncs::LinkProgram> ("LinkProgram"),
};
/* What it does cost: proof that calls are counted. */
static const CountedFunction kExpected[] = {counted<&GstGLFuncs::DrawArrays> ("DrawArrays"),
    counted<&GstGLFuncs::BufferSubData> ("BufferSubData")};

struct Counting {
  bool begin;
  Counts forbidden, expected;
};

/* On the OpenGL thread. */
static void
count (GstGLContext *context, gpointer data)
{
  auto &counting = *static_cast<Counting *> (data);
  auto &gl = const_cast<GstGLFuncs &> (*context->gl_vtable);
  const auto run = [&] (std::span<const CountedFunction> functions, Counts &counts) {
    for (const CountedFunction &f : functions)
      if (counting.begin)
        f.install (gl);
      else
        counts[f.name] = f.remove (gl);
  };
  run (kForbidden, counting.forbidden);
  run (kExpected, counting.expected);
}

/* A slanted wall whose shape, place and size change from frame set to frame set, the largest first.
 */
static GstBuffer *
moving_wall (const Rig &rig, int i)
{
  GstBuffer *buffer = make_frame_set (rig, GstClockTime (i) * GST_SECOND / 30);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const int edge = 5 * (i % 8);
        const bool inside = x >= edge && x < 320 - edge && y >= edge / 2 && y < 240;
        image.depth.at (x, y) = inside ? guint16 (7000 + 3 * x + (x * y) % (i % 8 + 1)) : 0;
        image.colour.at (x, y) = {guint8 (x + i), guint8 (y), guint8 (200 - x / 2), 0};
      }
  return buffer;
}

static void
count_calls (const char *properties)
{
  const Rig rig = ring_rig (4);
  const std::string launch =
      std::string ("striprender backend=opengl ") + properties +
      " ! capsfilter caps=\"video/x-raw(memory:GLMemory),width=320,height=240\"";
  GstHarness *h = gst_harness_new_parse (launch.c_str ());
  gst_harness_set_sink_caps_str (h, "video/x-raw(memory:GLMemory),format=RGBA");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstGLContext *context = nullptr;
  constexpr int kWarmUp = 16, kCounted = 24;
  Counting counting{true, {}, {}};
  for (int i = 0; i < kWarmUp + kCounted; i++) {
    if (i == kWarmUp)
      gst_gl_context_thread_add (context, count, &counting);
    GstBuffer *picture = gst_harness_push_and_pull (h, moving_wall (rig, i));
    fail_unless (picture != nullptr, "%s: no picture %d", properties, i);
    GstMemory *memory = gst_buffer_peek_memory (picture, 0);
    fail_unless (gst_is_gl_memory (memory));
    if (!context)
      context = GST_GL_CONTEXT (gst_object_ref (GST_GL_BASE_MEMORY_CAST (memory)->context));
    gst_buffer_unref (picture);
  }
  counting.begin = false;
  gst_gl_context_thread_add (context, count, &counting);
  for (const auto &[name, calls] : counting.forbidden)
    fail_unless (calls == 0, "%s: %d calls of gl%s in %d frame sets", properties, calls,
        name.c_str (), kCounted);
  for (const auto &[name, calls] : counting.expected)
    fail_unless (calls >= kCounted, "%s: %d calls of gl%s, expected at least one a frame set",
        properties, calls, name.c_str ());
  gst_object_unref (context);
  gst_harness_teardown (h);
}

GST_START_TEST (test_steady_state_reads_back_and_allocates_nothing)
{
  SKIP_WITHOUT_OPENGL ();
  for (const char *properties : {"mode=blend", "mode=strips", "mode=rectangles", "mode=points"})
    count_calls (properties);
}
GST_END_TEST;

static Suite *
stripcalls_suite ()
{
  Suite *s = suite_create ("stripcalls");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_steady_state_reads_back_and_allocates_nothing);
  return s;
}

GST_CHECK_MAIN (stripcalls);
