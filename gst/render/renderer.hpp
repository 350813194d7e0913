/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <array>
#include <rangecast/surface/surface_scene.hpp>
#include <span>

#include "layerpainters.hpp"
#include "settings.hpp"
#include "strippainter.hpp"

/** Where the picture of one eye lies in an output buffer. */
struct EyeViewport {
  double side = 0;           ///< of the camera: -1 left, 1 right, 0 neither
  guint memory = 0;          ///< number of the buffer's memory
  int x = 0, y = 0;          ///< pixels of that memory's picture
  int width = 0, height = 0; ///< pixels
  double aspect = 1;         ///< width / height as displayed
};

/** One or two eyes' pictures, from multiview-mode and multiview-flags of the caps. */
class MultiviewLayout {
public:
  MultiviewLayout () = default;
  explicit MultiviewLayout (const GstVideoInfo &info);
  [[nodiscard]] std::span<const EyeViewport> eyes () const { return {eyes_.data (), count_}; }

private:
  std::array<EyeViewport, 2> eyes_;
  std::size_t count_ = 0;
};

/** Supported values of multiview-mode, for caps. */
#define STRIP_MULTIVIEW_MODES "{ mono, left, right, side-by-side, top-bottom, separated }"

/** What to draw into one output buffer. */
struct RenderJob {
  const rangecast::SurfaceScene *scene;
  const StripRenderSettings *settings;
  const rangecast::SceneFrame *frame; ///< the camera's default position
  rangecast::Orbit orbit;
  rangecast::ImageView<const rangecast::Rgbx> panel = {}; ///< over the picture; empty: none
  bool panel_changed = false;
};

/** Renders scenes into buffers of OpenGL memory: the frame set, for one or two eyes, the
 *  background, the rig's cameras and the panel. Has objects of OpenGL's from start() to stop(). */
class Renderer {
public:
  /** @name On the OpenGL thread @{ */
  bool start (GstGLContext *context, GError **error);
  void stop ();
  /** @return false if OpenGL has no framebuffer as large as the pictures; `error` names sizes */
  bool set_output (GstGLContext *context, const GstVideoInfo &info, GError **error);
  /** @} */

  struct Result {
    bool drawn = false;
    const char *reason = "the output is not OpenGL memory"; ///< why it is not drawn
    guint64 uploaded = 0;              ///< bytes; 0 if the scene was uploaded before
    rangecast::OrbitMatrices matrices; ///< of the first eye
    int width = 0, height = 0;         ///< of the first eye's picture, pixels
  };
  /** Draws on the OpenGL thread and waits for that. The buffer's memories are OpenGL's. Exceptions
   *  of the OpenGL thread are thrown here. */
  Result draw (GstGLContext *context, const RenderJob &job, GstBuffer *out);

private:
  struct Call;
  void draw_buffer (Call &call);
  bool upload (Call &call);
  void draw_memory (Call &call);
  void draw_eye (Call &call, const EyeViewport &viewport);
  RenderPicture make_picture (
      const RenderJob &job, const EyeViewport &viewport, Result &result) const;

  GstGLContext *context_ = nullptr;
  GstGLFramebuffer *framebuffer_ = nullptr;
  int width_ = 0, height_ = 0;
  MultiviewLayout layout_;
  guint64 uploaded_ = 0; /* serial of the scene that OpenGL has; 0: none */
  StripPainter painter_;
  BackgroundPainter background_painter_;
  PanelPainter panel_painter_;
};
