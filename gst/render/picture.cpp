/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "picture.hpp"

#include <algorithm>
#include <cstring>
#include <rangecast/render/software_renderer.hpp>
#include <utility>

using rangecast::ImageView;
using rangecast::Rgbx;
using rangecast::SurfacePicture;

MultiviewLayout::MultiviewLayout (const GstVideoInfo &info)
{
  const int width = GST_VIDEO_INFO_WIDTH (&info), height = GST_VIDEO_INFO_HEIGHT (&info);
  guint flags; /* copied: caps may have bits that are not in the enumeration */
  static_assert (sizeof flags == sizeof GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info));
  std::memcpy (&flags, &GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info), sizeof flags);
  const bool half = (flags & GST_VIDEO_MULTIVIEW_FLAGS_HALF_ASPECT) != 0;
  EyeViewport &first = eyes_[0], &second = eyes_[1];
  first = {0, 0, 0, 0, width, height, 1};
  first.aspect = double (width) * GST_VIDEO_INFO_PAR_N (&info) /
                 (double (height) * GST_VIDEO_INFO_PAR_D (&info));
  count_ = 2;
  switch (GST_VIDEO_INFO_MULTIVIEW_MODE (&info)) {
    case GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE:
      first.aspect *= half ? 1 : 0.5;
      first.width = (width + 1) / 2;
      second = first;
      second.x = width - second.width;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM:
      first.aspect *= half ? 1 : 2;
      first.height = (height + 1) / 2;
      second = first;
      second.y = height - second.height;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_SEPARATED:
      second = first;
      second.memory = 1;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_LEFT:
    case GST_VIDEO_MULTIVIEW_MODE_RIGHT:
      first.side = GST_VIDEO_INFO_MULTIVIEW_MODE (&info) == GST_VIDEO_MULTIVIEW_MODE_LEFT ? -1 : 1;
      [[fallthrough]];
    default:
      count_ = 1;
      return;
  }
  first.side = -1;
  second.side = 1;
  if (flags & GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST)
    std::swap (first.side, second.side);
}

SurfacePicture
make_picture (const RenderJob &job, const EyeViewport &viewport, const GstVideoInfo &info,
    RenderResult &result)
{
  const StripRenderSettings &settings = *job.settings;
  const rangecast::SceneFrame &frame = *job.frame;
  const rangecast::Eye eye = {viewport.side * settings.eye_distance_m / 2, settings.convergence_m};
  const auto matrices =
      rangecast::orbit_matrices (frame, job.orbit, viewport.aspect, true, eye, job.scene->hull (),
          std::max (
              2 * rangecast::kViewGap_m, settings.blend_range_m) /* by which surfaces move back */);
  if (result.width == 0) {
    result.matrices = matrices;
    result.width = viewport.width;
    result.height = viewport.height;
  }
  SurfacePicture picture;
  picture.width = info.width;
  picture.height = info.height;
  picture.part = {viewport.x, viewport.y, viewport.width, viewport.height};
  rangecast::PicturePart part{
      double (viewport.width) / info.width, double (viewport.height) / info.height};
  part.x = double (2 * viewport.x + viewport.width) / info.width - 1;
  part.y = double (2 * viewport.y + viewport.height) / info.height - 1;
  picture.clip_from_world = rangecast::in_part (matrices.clip_from_world, part);
  for (int i = 0; i < 4; i++)
    picture.background[i] =
        float (settings.background >> (i == 3 ? 24 : 16 - 8 * i) & 0xff) / 255.f;
  if (picture.background[3] >= 1)
    picture.background_shade = float (settings.background_shade);
  picture.point_size = float (settings.point_size);
  picture.pixels_per_unit = float (rangecast::pixels_per_unit (frame, job.orbit, viewport.height));
  picture.mode = settings.strips.mode;
  /* What one camera sees is open at the back, where there is nothing else to see. */
  picture.back_faces = job.scene->rig_views () == 1;
  picture.blend_range_m = settings.blend_range_m;
  picture.covered = picture.part;
  if (picture.mode != rangecast::StripMode::kPoints) /* which may be of any size */
    picture.covered = rangecast::covered_part (
        picture.clip_from_world, job.scene->hull (), info.width, info.height, picture.part);
  return picture;
}

namespace {

class SoftwareBackend : public RenderBackend {
public:
  explicit SoftwareBackend (const GstVideoInfo &info) : info_ (info), layout_ (info) {}

  [[nodiscard]] const char *name () const override { return "software"; }

  RenderResult draw (const RenderJob &job, GstBuffer *out) override
  {
    RenderResult result;
    GstVideoFrame frame;
    if (!gst_video_frame_map (&frame, &info_, out, GST_MAP_WRITE)) {
      result.failure = "its memory cannot be written";
      return result;
    }
    const ImageView<Rgbx> pixels = {static_cast<Rgbx *> (GST_VIDEO_FRAME_PLANE_DATA (&frame, 0)),
        info_.width, info_.height, GST_VIDEO_FRAME_PLANE_STRIDE (&frame, 0)};
    const GstVideoFormat format = GST_VIDEO_INFO_FORMAT (&info_);
    const bool is_bgra = format == GST_VIDEO_FORMAT_BGRA || format == GST_VIDEO_FORMAT_BGRx;
    const std::unique_ptr<GstVideoFrame, decltype (&gst_video_frame_unmap)> mapped (
        &frame, gst_video_frame_unmap);
    for (const EyeViewport &eye : layout_.eyes ())
      renderer_.draw (
          make_picture (job, eye, info_, result), job.scene->layers (), pixels, is_bgra);
    return result;
  }

private:
  const GstVideoInfo info_;
  const MultiviewLayout layout_;
  rangecast::SoftwareRenderer renderer_;
};

} // namespace

std::unique_ptr<RenderBackend>
make_software_backend (const GstVideoInfo &info)
{
  return std::make_unique<SoftwareBackend> (info);
}
