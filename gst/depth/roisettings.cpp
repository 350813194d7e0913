/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "roisettings.hpp"

using rangecast::Cue;

#define GST_TYPE_ROI_EXTRACT_CUE (gst_roi_extract_cue_get_type ())
static GType
gst_roi_extract_cue_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (Cue::kBoth), "Depth and colour", "both"},
        {int (Cue::kColour), "Colour only", "colour"}, {int (Cue::kDepth), "Depth only", "depth"},
        {}};
    return g_enum_register_static ("GstRoiExtractCue", values);
  }();
  return type;
}

PropertyTable<RoiSettings> &
roi_properties ()
{
  using S = RoiSettings;
  using Segmentation = rangecast::SegmentationSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::number<&S::segmentation, &Segmentation::noise_factor> ("noise-factor", "Noise factor",
          "Number of standard deviations of the background's noise from which a difference counts",
          0, 100, kControllable),
      P::number<&S::segmentation, &Segmentation::depth_threshold_m> ("depth-threshold",
          "Depth threshold",
          "Minimum distance in front of the background in metres at which depth marks a pixel as "
          "foreground",
          0, 10, kControllable),
      P::number<&S::segmentation, &Segmentation::colour_threshold> ("colour-threshold",
          "Colour threshold",
          "Minimum chromatic distortion in grey levels at which colour marks a pixel as foreground",
          0, 255, kControllable),
      P::number<&S::segmentation, &Segmentation::shadow> ("shadow", "Shadow limit",
          "Ratio to the background's brightness down to which a pixel may be a shadow", 0, 1,
          kControllable),
      P::number<&S::segmentation, &Segmentation::highlight> ("highlight", "Highlight limit",
          "Ratio to the background's brightness up to which a pixel may be a change of light", 1,
          10, kControllable),
      P::number<&S::adapt_time_s> ("adapt-time", "Adaptation time",
          "Time constant in seconds with which the background follows slow changes (0 = never)", 0,
          100000, kControllable),
      P::number<&S::segmentation, &Segmentation::min_area> ("min-area", "Minimum area",
          "Minimum area of a foreground region in pixels; smaller regions are cleared", 0, 1000000,
          kControllable),
      P::number<&S::segmentation, &Segmentation::max_hole> ("max-hole", "Maximum hole area",
          "Maximum area of a hole in pixels that is closed", 0, 1000000, kControllable),
      P::number<&S::segmentation, &Segmentation::max_people> ("max-people", "Maximum people",
          "Number of largest foreground regions to keep (0 = all)", 0, 1000, kControllable),
      P::number<&S::segmentation, &Segmentation::fill> ("fill", "Depth extrapolation",
          "Distance in pixels to which depth is extrapolated into foreground without depth; up to "
          "five times as far where the hue differs from the background (0 = off)",
          0, 1000, kControllable),
      P::number<&S::segmentation, &Segmentation::fringe> ("fringe", "Fringe width",
          "Minimum width in pixels of a region that is nearer than the background but looks like "
          "it (0 = trust depth at silhouettes, for cameras with exact depth edges)",
          0, 99, kControllable),
      P::number<&S::margin> ("margin", "Margin", "Margin added to each side of the ROI in pixels",
          0, 1000, kControllable),
      P::number<&S::n_threads> ("n-threads", "Threads",
          "Number of threads that process views (0 = one per CPU core)", 0, 64, kControllable),
      P::number<&S::background_frames> ("background-frames", "Background frames",
          "Number of frames of the empty scene from which to learn the background", 1, 10000,
          kMutablePlaying),
      P::number<&S::settle_frames> ("settle-frames", "Settle frames",
          "Number of frames to skip before learning, while automatic exposure settles", 0, 100000,
          kMutableReady),
      P::text<&S::background_file> ("background-file", "Background file",
          "Background file to load instead of learning (unset = learn)", kMutableReady),
      P::text<&S::save_background> ("save-background", "Save background",
          "Background file to write after learning and at EOS (.yml, .yaml or .json, optionally "
          "with .gz)",
          kMutablePlaying),
      P::enumeration<&S::segmentation, &Segmentation::cue> ("cue", "Segmentation cue",
          "What distinguishes foreground from background", GST_TYPE_ROI_EXTRACT_CUE, kControllable),
      P::boolean<&S::segmentation, &Segmentation::follow_light> ("follow-light", "Follow light",
          "Compensate brightness and white balance changes of the whole image", kControllable),
  };
  return table;
}
