/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

using Choice = RenderBackendChoice;
using rangecast::StripMode;

static const GEnumValue kModes[] = {
    {int (StripMode::kBlend), "Surfaces of all views, blended where they overlap", "blend"},
    {int (StripMode::kStrips), "Triangle strips along the rows", "strips"},
    {int (StripMode::kRectangles), "One rectangle per pixel", "rectangles"},
    {int (StripMode::kPoints), "One point per pixel", "points"}, {}};

static const GEnumValue kBackends[] = {
    {int (Choice::kAuto),
        "OpenGL where downstream accepts its memory and it is not itself software", "auto"},
    {int (Choice::kSoftware), "The CPU, into system memory", "software"},
    {int (Choice::kOpenGl), "OpenGL, into OpenGL memory", "opengl"}, {}};

PropertyTable<StripRenderSettings> &
strip_properties ()
{
  using S = StripRenderSettings;
  using rangecast::Orbit;
  using rangecast::Vec3;
  using Strips = rangecast::StripSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::azimuth_deg> ("azimuth", "Azimuth",
          "Camera angle around the scene in degrees, positive to the right of the first view", -360,
          360, kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::elevation_deg> ("elevation", "Elevation",
          "Camera angle above the first view in degrees", -89, 89, kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::distance_m> ("distance", "Distance",
          "Distance of the camera from its target in metres (0 = as the first view)", 0, 1000,
          kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::fov_deg> ("field-of-view",
          "Field of view", "Vertical field of view in degrees (0 = as the first view)", 0, 170,
          kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::pan, &Vec3::x> ("pan-x", "Pan x",
          "Shift of the camera target to the first view's right in metres", -1000, 1000,
          kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::pan, &Vec3::y> ("pan-y", "Pan y",
          "Shift of the camera target upwards in metres", -1000, 1000, kControllable),
      P::number<&S::camera, &OrbitControl::orbit, &Orbit::pan, &Vec3::z> ("pan-z", "Pan z",
          "Shift of the camera target towards the first view in metres", -1000, 1000,
          kControllable),
      P::number<&S::camera, &OrbitControl::auto_orbit> ("auto-orbit", "Auto orbit",
          "Speed of automatic rotation in degrees per second", -3600, 3600, kControllable),
      P::number<&S::strips, &Strips::depth_step> ("depth-step", "Depth step",
          "Depth difference, as a fraction of depth, beyond which neighbouring pixels are not "
          "joined",
          0, 1, kControllable),
      P::number<&S::blend_range_m> ("blend-range", "Blend range",
          "Depth behind the nearest surface in metres within which views are blended with "
          "mode=blend, divided by the sine of the angle between the view's ray and the viewer's",
          0, 1, kControllable),
      P::number<&S::background_shade> ("background-shade", "Background shade",
          "Vertical gradient of an opaque background, as a fraction of its colour (0 = none)", 0, 1,
          kControllable),
      P::number<&S::point_size> ("point-size", "Point size",
          "Size of a point relative to the footprint of its pixel, for mode=points", 0.1, 100,
          kControllable),
      P::number<&S::eye_distance_m> ("eye-distance", "Eye distance",
          "Distance between the eyes in metres, for stereoscopic output", 0, 10, kControllable),
      P::number<&S::convergence_m> ("convergence", "Convergence",
          "Distance of zero parallax in metres, for stereoscopic output (0 = camera target, 1000 = "
          "headsets)",
          0, 1000, kControllable),
      P::boolean<&S::fit> ("fit", "Fit to content",
          "Fit the view to the content at the start of the stream and on the keys r and Home; "
          "camera properties then count from that view",
          kControllable),
      P::boolean<&S::keep_rate> ("keep-rate", "Keep rate",
          "Output at the negotiated frame rate even if it is the input's, repeating frames while a "
          "live stream stalls",
          kMutableReady),
      P::boolean<&S::tint_views> (
          "tint-views", "Tint views", "Tint each point with the colour of its view", kControllable),
      P::enumeration<&S::strips, &Strips::mode> (
          "mode", "Mode", "Rendering mode", "GstStripRenderMode", kModes, kControllable),
      P::enumeration<&S::backend> ("backend", "Backend",
          "Renderer; the one in use is reported in stats", "GstStripRenderBackend", kBackends,
          kMutableReady),
      P::number<&S::background> (
          "background", "Background", "Background colour, ARGB", 0, G_MAXUINT32, kControllable),
      P::number<&S::view_mask> ("view-mask", "View mask",
          "Bit mask of the views to draw; bit n is view-id n", 0, G_MAXUINT64, kControllable),
  };
  return table;
}
