/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <array>
#include <memory>
#include <rangecast/surface/painting.hpp>
#include <span>
#include <vector>

#include "settings.hpp"

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

/** Supported values of multiview-mode, for caps; OpenGL memory also has `separated`. */
#define STRIP_MULTIVIEW_MODES "mono, left, right, side-by-side, top-bottom"
#define STRIP_SYSTEM_CAPS                                                                          \
  GST_VIDEO_CAPS_MAKE ("{ RGBA, BGRA, RGBx, BGRx }")                                               \
  ", multiview-mode = (string) { " STRIP_MULTIVIEW_MODES " }"

/** What to draw into one output buffer. */
struct RenderJob {
  const rangecast::SurfaceScene *scene;
  const StripRenderSettings *settings;
  const rangecast::SceneFrame *frame; ///< the camera's default position
  rangecast::Orbit orbit;
};

struct RenderResult {
  const char *failure = nullptr;     ///< why it is not drawn
  guint64 uploaded = 0;              ///< bytes; 0 if the scene was uploaded before
  rangecast::OrbitMatrices matrices; ///< of the first eye
  int width = 0, height = 0;         ///< of the first eye's picture, pixels
};

/** Draws scenes: the frame set, for one or two eyes, and the background. */
class RenderBackend {
public:
  virtual ~RenderBackend () = default;
  [[nodiscard]] virtual const char *name () const = 0;
  /** May throw. */
  virtual RenderResult draw (const RenderJob &job, GstBuffer *out) = 0;
};

/** Draws with the CPU, into system memory. */
std::unique_ptr<RenderBackend> make_software_backend (const GstVideoInfo &info);

/** The picture of one eye. @param[in,out] result  gets what is of the first eye */
rangecast::SurfacePicture make_picture (const RenderJob &job, const EyeViewport &viewport,
    const GstVideoInfo &info, RenderResult &result);
