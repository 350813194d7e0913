/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <atomic>
#include <rangecast/geometry/image_view.hpp>

/** How a stereo camera packs its two views into one image. */
enum class Packing { kAuto, kNone, kSideBySide, kTopBottom };

/** Lets pad left take images that contain both views of a stereo camera: all that comes there goes
 *  on to pad right, too, which is not linked, so that pairs form as usual. */
class PackedInput {
public:
  /** Watches pad left. For instance_init, once; both pads are the element's. */
  void watch (GstElement *element, GstPad *left, GstPad *right);
  /** Before the pads are activated. kAuto: as field multiview-mode of the caps says. */
  void start (Packing packing);
  /** Before the pads are deactivated: pad left's thread may wait at pad right. */
  void stop ();

  /** @name Any thread, after the first caps: the packing of a stream does not change @{ */
  [[nodiscard]] bool is_packed () const
  {
    return packing_ == Packing::kSideBySide || packing_ == Packing::kTopBottom;
  }
  /** The size of one view, pixels. @return false if the image cannot be divided */
  bool view_size (const GstVideoInfo &image, int &width, int &height) const;
  /** One view of an image, or the image if it contains one view. */
  template <typename Pixel>
  rangecast::ImageView<Pixel> view (const rangecast::ImageView<Pixel> &image, bool right) const
  {
    const int width = packing_ == Packing::kSideBySide ? image.width / 2 : image.width,
              height = packing_ == Packing::kTopBottom ? image.height / 2 : image.height;
    const bool second = right != right_first_;
    return image.crop (
        second ? image.width - width : 0, second ? image.height - height : 0, width, height);
  }
  /** @} */

private:
  const char *choose_packing (GstEvent *caps);
  GstPadProbeReturn handle (GstPadProbeInfo *info);

  GstElement *element_ = nullptr;
  GstPad *left_ = nullptr, *right_ = nullptr;
  Packing setting_ = Packing::kAuto;
  std::atomic<Packing> packing_ = Packing::kAuto; /* kAuto: no caps yet */
  std::atomic<bool> right_first_ = false;
  bool refused_ = false; /* pad left's streaming thread: after an error */
};
