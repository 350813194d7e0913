/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "target.hpp"

#include "truth.hpp"

namespace bench {

Target::Target (GstGLContext *context) : context_ (context)
{
  GstVideoInfo info;
  gst_video_info_set_format (&info, GST_VIDEO_FORMAT_RGBA, kWidth, kHeight);
  auto params = reinterpret_cast<GstGLAllocationParams *> (gst_gl_video_allocation_params_new (
      context, nullptr, &info, 0, nullptr, GST_GL_TEXTURE_TARGET_2D, GST_GL_RGBA));
  auto allocator = GST_GL_BASE_MEMORY_ALLOCATOR (gst_gl_memory_allocator_get_default (context));
  memory_ = reinterpret_cast<GstGLMemory *> (gst_gl_base_memory_alloc (allocator, params));
  gst_gl_allocation_params_free (params);
  gst_object_unref (allocator);
  framebuffer_ = gst_gl_framebuffer_new_with_default_depth (context, kWidth, kHeight);
}

Target::~Target ()
{
  gst_clear_object (&framebuffer_);
  if (memory_)
    gst_memory_unref (GST_MEMORY_CAST (memory_));
}

guint64
Target::draw (Way &way, const rangecast::SurfacePicture &picture)
{
  if (way.own_picture ())
    return way.draw (picture);
  struct Job {
    Way &way;
    const rangecast::SurfacePicture &picture;
    guint64 bytes;
  } job = {way, picture, 0};
  GstMapInfo map; /* so that reading it back knows of the change */
  gst_memory_map (GST_MEMORY_CAST (memory_), &map, GstMapFlags (GST_MAP_WRITE | GST_MAP_GL));
  gst_gl_framebuffer_draw_to_texture (
      framebuffer_, memory_,
      +[] (gpointer data) -> gboolean {
        auto j = static_cast<Job *> (data);
        j->bytes = j->way.draw (j->picture);
        return TRUE;
      },
      &job);
  context_->gl_vtable->Finish ();
  gst_memory_unmap (GST_MEMORY_CAST (memory_), &map);
  return job.bytes;
}

cv::Mat
Target::read (const Way &way) const
{
  if (const cv::Mat *own = way.own_picture ())
    return own->clone ();
  GstMapInfo map;
  gst_memory_map (GST_MEMORY_CAST (memory_), &map, GST_MAP_READ);
  const cv::Mat rgba = cv::Mat (kHeight, kWidth, CV_8UC4, map.data).clone ();
  gst_memory_unmap (GST_MEMORY_CAST (memory_), &map);
  return rgba;
}

} // namespace bench
