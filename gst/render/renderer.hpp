/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "backgroundpainter.hpp"
#include "camerapainter.hpp"
#include "multisampler.hpp"
#include "multiviewlayout.hpp"
#include "panelpainter.hpp"
#include "scene.hpp"
#include "settings.hpp"
#include "strippainter.hpp"

/** What to draw into one output buffer. */
struct RenderJob {
  const StripScene *scene;
  const StripRenderSettings *settings;
  const rangecast::SceneFrame *frame; ///< where the camera's home is
  rangecast::Orbit orbit;
  rangecast::ImageView<const rangecast::Rgbx> panel = {}; ///< over the picture; empty: none
  bool panel_changed = false;
};

/** Draws frame sets into buffers of OpenGL memory: both eyes, cameras, statistics. What is OpenGL's
 *  own lives from start() to stop(). */
class Renderer {
public:
  /** @name In the GL thread @{ */
  bool start (GstGLContext *context, GError **error);
  void stop ();
  /** @return false if OpenGL has no framebuffer as large as the pictures; `error` names sizes */
  bool set_output (GstGLContext *context, const GstVideoInfo &info, GError **error);
  /** @} */
  /** Whether mode blend can be drawn, once started. */
  [[nodiscard]] bool can_blend () const { return can_blend_; }

  struct Result {
    bool drawn = false;
    const char *reason = "the output is not its memory"; ///< why it is not drawn
    guint64 uploaded = 0;              ///< bytes; a scene that is there already costs none
    rangecast::OrbitMatrices matrices; ///< of the first eye
    int width = 0, height = 0;         ///< of the first eye's picture, pixels
  };
  /** Draws in the GL thread and waits for it. The buffer's memories are OpenGL's. Exceptions of the
   *  GL thread are thrown here. */
  Result draw (GstGLContext *context, const RenderJob &job, GstBuffer *out);

private:
  struct Call;
  static void draw_in_gl_thread (GstGLContext *context, gpointer call);
  static gboolean draw_bound (gpointer call);
  bool upload (Call &call);
  void draw_memory (Call &call);
  void draw_memories (Call &call);
  void draw_eye (Call &call, const EyeViewport &place, bool antialiased);
  StripPainter::Picture make_picture (
      const RenderJob &job, const EyeViewport &place, Result &result) const;

  GstGLContext *context_ = nullptr;
  GstGLFramebuffer *framebuffer_ = nullptr;
  int width_ = 0, height_ = 0;
  bool can_blend_ = false;
  MultiviewLayout layout_;
  guint64 uploaded_ = 0; /* serial of the scene that OpenGL has; 0: none */
  StripPainter painter_;
  BackgroundPainter background_painter_;
  CameraPainter camera_painter_;
  PanelPainter panel_painter_;
  Multisampler multisampler_;
};
