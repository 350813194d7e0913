/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "opengl.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <utility>

#include "striprenderprivate.hpp"
#include "surfacepainter.hpp"

namespace {

constexpr auto kApis = GstGLAPI (GST_GL_API_OPENGL | GST_GL_API_OPENGL3 | GST_GL_API_GLES2);

/* Calls a function on the context's thread and waits for it. What it throws is thrown here. */
template <typename Function>
void
on_gl_thread (GstGLContext *context, const Function &function)
{
  struct Call {
    const Function &function;
    std::exception_ptr exception; /* must not pass through C, nor end the OpenGL thread */
  } call = {function, {}};
  gst_gl_context_thread_add (
      context,
      [] (GstGLContext *, gpointer data) {
        auto c = static_cast<Call *> (data);
        try {
          c->function ();
        } catch (...) {
          c->exception = std::current_exception ();
        }
      },
      &call);
  if (call.exception)
    std::rethrow_exception (call.exception);
}

/* An error that no further call can mend. @return why, or nullptr */
const char *
fatal_error (const GstGLFuncs *gl)
{
  constexpr GLenum kContextLost = 0x0507; /* of OpenGL 4.5 and OpenGL ES 3.2 */
  constexpr int kMaxErrors = 8; /* several may be queued; a lost context may report indefinitely */
  GLenum error = gl->GetError ();
  for (int i = 1; i < kMaxErrors && error != GL_NO_ERROR; i++, error = gl->GetError ())
    if (error == kContextLost || error == GL_OUT_OF_MEMORY)
      return error == kContextLost ? "OpenGL's context is lost" : "OpenGL is out of memory";
  return nullptr;
}

class GlBackend : public RenderBackend {
public:
  explicit GlBackend (GstGLContext *context) : context_ (GST_GL_CONTEXT (gst_object_ref (context)))
  {
  }
  ~GlBackend () override
  {
    on_gl_thread (context_, [this] {
      painter_.stop ();
      gst_clear_object (&framebuffer_);
    });
    gst_object_unref (context_);
  }
  [[nodiscard]] GstGLContext *context () const { return context_; }
  [[nodiscard]] const char *name () const override { return "opengl"; }

  /* Makes it ready for pictures of that size; the first time, compiles shaders. */
  bool set_output (const GstVideoInfo &info, GError **error)
  {
    bool ready = false;
    on_gl_thread (context_, [&] {
      gint largest = 0;
      context_->gl_vtable->GetIntegerv (GL_MAX_TEXTURE_SIZE, &largest);
      info_ = info;
      layout_ = MultiviewLayout (info);
      if (!framebuffer_)
        framebuffer_ = gst_gl_framebuffer_new (context_);
      if (std::max (info.width, info.height) > largest)
        g_set_error (error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED,
            "%dx%d is too large; set caps of at most %dx%d", info.width, info.height, largest,
            largest);
      else
        ready = std::exchange (is_started_, true) || painter_.start (context_, error);
    });
    return ready;
  }

  RenderResult draw (const RenderJob &job, GstBuffer *out) override
  {
    RenderResult result;
    const guint memories = layout_.eyes ().back ().memory + 1;
    struct Maps { /* mark the memories as changed for readers on the CPU */
      GstBuffer *buffer;
      std::array<GstMapInfo, 2> infos;
      guint count = 0;
      ~Maps ()
      {
        while (count-- > 0)
          gst_memory_unmap (gst_buffer_peek_memory (buffer, count), &infos[count]);
      }
    } maps = {out, {}};
    for (; maps.count < memories; maps.count++)
      if (!gst_memory_map (gst_buffer_peek_memory (out, maps.count), &maps.infos[maps.count],
              GstMapFlags (GST_MAP_WRITE | GST_MAP_GL))) {
        result.failure = "the output cannot be mapped";
        return result;
      }
    on_gl_thread (context_, [&] { draw_buffer (job, out, memories, result); });
    return result;
  }

private:
  /* On the OpenGL thread. Vertices are uploaded once for all pictures of a scene: for both eyes,
   * and for as long as it is held. */
  void draw_buffer (const RenderJob &job, GstBuffer *out, guint memories, RenderResult &result)
  {
    if (uploaded_ != job.scene->serial ())
      result.uploaded += painter_.upload (job.scene->layers ());
    uploaded_ = job.scene->serial ();
    for (guint i = 0; i < memories && !result.failure; i++)
      draw_memory (job, GST_GL_MEMORY_CAST (gst_buffer_peek_memory (out, i)), i, result);
    if (const char *reason = fatal_error (context_->gl_vtable))
      result.failure = reason;
    GstGLSyncMeta *sync = gst_buffer_get_gl_sync_meta (out);
    if (!result.failure && sync) /* other contexts wait there for our commands */
      gst_gl_sync_meta_set_sync_point (sync, context_);
  }

  /* Draws what one memory of the buffer shows. */
  void draw_memory (const RenderJob &job, GstGLMemory *memory, guint number, RenderResult &result)
  {
    gst_gl_framebuffer_bind (framebuffer_);
    gst_gl_framebuffer_attach (
        framebuffer_, GL_COLOR_ATTACHMENT0, reinterpret_cast<GstGLBaseMemory *> (memory));
    for (const EyeViewport &eye : layout_.eyes ())
      if (eye.memory == number && !result.failure)
        result.failure =
            painter_.draw (make_picture (job, eye, info_, result), job.scene->layers ());
    gst_gl_context_clear_framebuffer (context_);
  }

  GstGLContext *const context_;
  GstVideoInfo info_{};
  MultiviewLayout layout_;
  GstGLFramebuffer *framebuffer_ = nullptr;
  bool is_started_ = false;
  guint64 uploaded_ = 0; /* serial of the scene that OpenGL has; 0: none */
  SurfacePainter painter_;
};

} // namespace

bool
OpenGl::open (GstElement *element)
{
  std::lock_guard guard (lock_);
  if (!gst_gl_ensure_element_data (element, &display_, &other_))
    return false;
  gst_gl_display_filter_gl_api (display_, kApis);
  return true;
}

void
OpenGl::close ()
{
  std::lock_guard guard (lock_);
  gst_clear_object (&context_);
  gst_clear_object (&other_);
  gst_clear_object (&display_);
}

void
OpenGl::set (GstElement *element, GstContext *context)
{
  std::lock_guard guard (lock_);
  gst_gl_handle_set_context (element, context, &display_, &other_);
  if (display_)
    gst_gl_display_filter_gl_api (display_, kApis);
}

bool
OpenGl::answer (GstElement *element, GstQuery *query)
{
  std::lock_guard guard (lock_);
  return gst_gl_handle_context_query (element, query, display_, context_, other_);
}

/* The context of a neighbour, or a new one. Returns: (transfer none) */
GstGLContext *
OpenGl::get (GstElement *element, GError **error)
{
  if (!open (element)) {
    g_set_error (
        error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "there is no OpenGL display");
    return nullptr;
  }
  /* Without the lock: neighbours may ask back. */
  GstGLContext *shared = nullptr;
  if (!gst_gl_query_local_gl_context (element, GST_PAD_SRC, &shared))
    gst_gl_query_local_gl_context (element, GST_PAD_SINK, &shared);
  std::lock_guard guard (lock_);
  if (context_ && context_->display != display_)
    gst_clear_object (&context_);
  if (!context_ && shared && shared->display == display_)
    context_ = GST_GL_CONTEXT (gst_object_ref (shared));
  gst_clear_object (&shared);
  if (!context_) {
    GST_OBJECT_LOCK (display_);
    do {
      gst_clear_object (&context_);
      context_ = gst_gl_display_get_gl_context_for_thread (display_, nullptr);
      if (!context_ && !gst_gl_display_create_context (display_, other_, &context_, error))
        break;
    } while (!gst_gl_display_add_context (display_, context_));
    GST_OBJECT_UNLOCK (display_);
  }
  return context_;
}

bool
OpenGl::is_fast (GstElement *element)
{
  constexpr const char *kSlow[] = {"llvmpipe", "softpipe", "swrast", "SwiftShader", "Software"};
  GstGLContext *context = get (element, nullptr);
  bool fast = false;
  if (context)
    on_gl_thread (context, [&] {
      const auto name =
          reinterpret_cast<const char *> (context->gl_vtable->GetString (GL_RENDERER));
      fast = name && has_shaders (context) && std::ranges::none_of (kSlow, [&] (const char *slow) {
        return std::strstr (name, slow) != nullptr;
      });
      GST_INFO_OBJECT (element, "OpenGL renderer: %s", name);
    });
  return fast;
}

std::unique_ptr<RenderBackend>
OpenGl::start (GstElement *element, const GstVideoInfo &info, std::unique_ptr<RenderBackend> before,
    GError **error)
{
  GstGLContext *context = get (element, error);
  if (!context)
    return nullptr;
  auto backend = dynamic_cast<GlBackend *> (before.get ());
  if (!backend || backend->context () != context) {
    backend = new GlBackend (context);
    before.reset (backend);
  }
  return backend->set_output (info, error) ? std::move (before) : nullptr;
}

bool
OpenGl::can_use (GstBufferPool *pool)
{
  return GST_IS_GL_BUFFER_POOL (pool) &&
         gst_gl_context_can_share (GST_GL_BUFFER_POOL (pool)->context, context_);
}

GstBufferPool *
OpenGl::make_pool ()
{
  return gst_gl_buffer_pool_new (context_);
}
