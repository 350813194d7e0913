/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "settings.hpp"

static const GFlagsValue kDresses[] = {{0, "Nothing", "none"},
    {rangecast::kDressHair, "Long hair with loose strands", "hair"},
    {rangecast::kDressGlasses, "Glasses", "glasses"},
    {rangecast::kDressCollar, "Open collar", "collar"},
    {rangecast::kDressHand, "Forearm and hand in front of the chest", "hand"},
    {rangecast::kDressAll, "All accessories", "all"}, {0, nullptr, nullptr}};

PropertyTable<AvatarSettings> &
avatar_properties ()
{
  using S = AvatarSettings;
  using Scene = rangecast::SceneSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::number<&S::scene, &Scene::views> (
          "views", "Views", "Number of stereo cameras in the rig", 1, 64, kMutableReady),
      P::number<&S::view_id> ("view-id", "View",
          "View to output, by view-id (-1 = all views on src, view 0 on left, right and third)",
          S::kAllViews, 63, kMutableReady),
      P::number<&S::scene, &Scene::arc_deg> ("arc", "Arc",
          "Arc covered by the cameras in degrees (360 = closed ring with view 0 in front of the "
          "figure, less = arc centred on its front)",
          1, 360, kMutableReady),
      P::number<&S::scene, &Scene::distance_m> ("distance", "Camera distance",
          "Distance from the left cameras to the figure's axis in metres", 0.5, 1.2, kMutableReady),
      P::number<&S::scene, &Scene::baseline_m> ("baseline", "Baseline",
          "Distance from the left camera to the right and to the third camera in metres", 0.01, 0.3,
          kMutableReady),
      P::number<&S::scene, &Scene::seed> ("seed", "Random seed",
          "Seed of the textures and the sensor noise", 0u, G_MAXUINT, kMutableReady),
      P::number<&S::scene, &Scene::noise_sigma> ("noise", "Sensor noise",
          "Standard deviation of the sensor noise in grey levels (0 = none)", 0, 20, kMutableReady),
      P::number<&S::scene, &Scene::motion> ("motion", "Motion amplitude",
          "Amplitude of the figure's motion (0 = still, 1 = head turns by 20 degrees)", 0, 2,
          kMutableReady),
      P::number<&S::empty_frames> ("empty-frames", "Empty frames",
          "Number of frames at the start that show the room without the figure", 0u, G_MAXUINT,
          kMutableReady),
      P::number<&S::loop_frames> ("loop-frames", "Loop frames",
          "Render this many frames before the first one and replay them forwards and backwards; "
          "left, right and third pads only, at most 1 GiB per camera (0 = render every frame)",
          0u, G_MAXUINT, kMutableReady),
      P::number<&S::num_buffers> ("num-buffers", "Number of buffers",
          "Number of frames to output before EOS (-1 = unlimited)", -1, G_MAXINT, kMutableReady),
      P::boolean<&S::is_live> ("is-live", "Is live",
          "Act as a live source, with frames at multiples of the frame period on the pipeline "
          "clock",
          kMutableReady),
      P::text<&S::scene, &Scene::model> ("location", "Location",
          "glTF file with the model to show (unset = built-in figure)", kMutableReady),
      P::number<&S::scene, &Scene::model_top_m> ("model-top", "Model top",
          "Part of the model to keep, in metres below the crown after scaling it to a person 1.8 m "
          "tall (0 = the whole model scaled to 0.5 m, -1 = 0.5 for models of a standing person, "
          "else 0)",
          -1., 1.8, kMutableReady),
      P::text<&S::rig_export> ("rig-export", "Rig export",
          "File to write the calibration of all cameras to, YAML or JSON", kMutableReady),
      P::boolean<&S::person_only> ("range-person-only", "Crop to person",
          "Crop range images to the bounding box of the figures", kMutableReady),
      P::flags<&S::scene, &Scene::dress> ("dress", "Accessories",
          "Accessories of the built-in figure that add surfaces in front of one another",
          "GstAvatarTestSrcDress", kDresses, kMutableReady),
  };
  return table;
}
