/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <memory>
#include <string>

#include <opencv2/core.hpp>

#include "frames.hpp"
#include "render/surfacepainter.hpp"

namespace bench {

/** One way to a picture: what the CPU prepares, what is then drawn, and counts of it. */
class Way {
public:
  explicit Way (std::string name) : name_ (std::move (name)) {}
  virtual ~Way () = default;
  Way (const Way &) = delete;
  Way &operator= (const Way &) = delete;

  /** @param orbit  from where it will be drawn */
  virtual void build (const rangecast::Orbit &orbit) = 0;
  /** Draws into the bound framebuffer, in the GL thread, or in software into own_picture().
   *  @return bytes uploaded */
  virtual guint64 draw (const rangecast::SurfacePicture &picture) = 0;
  /** CV_8UC4, RGBA; nullptr: draws with OpenGL */
  [[nodiscard]] virtual const cv::Mat *own_picture () const { return nullptr; }
  [[nodiscard]] virtual std::size_t vertices () const = 0;
  [[nodiscard]] virtual std::size_t triangles () const = 0;
  [[nodiscard]] const std::string &name () const { return name_; }

private:
  const std::string name_;
};

/** Where the truth is taken from, degrees. */
rangecast::Orbit orbit_at (double azimuth_deg);
/** The picture from there. */
rangecast::SurfacePicture make_picture (const FrameSet &set, double azimuth_deg);

/** striprender's own, in one of its modes. The frame set must stay.
 *  @param painter  nullptr: in software
 *  @param held     only the first picture is of a new frame set: later ones are what a stream that
 *                  stalls, or the second eye, costs. Nobody else may use that painter. */
std::unique_ptr<Way> make_strip_way (std::string name, SurfacePainter *painter, const FrameSet &set,
    const rangecast::StripSettings &settings, bool held = false);

/** What others do, from a vertex buffer of places and colours that the CPU unprojects into: one GL
 *  point a pixel, or a grid surface: each quad of valid pixels two triangles, where its corners
 *  differ by no more than striprender's depth-step.
 *  @return nothing without OpenGL for it; `error` says why */
enum class Peer { kPoints, kGrid };
std::unique_ptr<Way> make_peer (
    std::string name, Peer peer, GstGLContext *context, const FrameSet &set, GError **error);

} // namespace bench
