/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as an access unit: planned and decoded into images of exactly the planned size. */
#include <memory>
#include <rangecast/neighbourcode/access_unit.hpp>

using namespace rangecast;

static Rig
two_views ()
{
  Rig rig;
  for (int id = 0; id < 2; id++) {
    View view;
    view.id = id;
    view.width = 64;
    view.height = 48;
    view.intrinsics = {60, 60, 31.5, 23.5};
    rig.views.push_back (view);
  }
  return rig;
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static AccessUnitDecoder &decoder = *[] {
    auto made = new AccessUnitDecoder;
    if (!made->set_rig (two_views ()).ok ())
      std::abort ();
    return made;
  }();
  DecoderResult result;
  const bool whole_rois = size % 2;
  decoder.plan ({data, size}, result, whole_rois);
  std::vector<std::unique_ptr<std::uint16_t[]>> depths;
  std::vector<std::unique_ptr<Rgbx[]>> colours;
  std::vector<RangeImage> images;
  for (const auto &view : decoder.views ()) {
    const int width = view.roi.width, height = view.roi.height;
    depths.push_back (std::make_unique<std::uint16_t[]> (std::size_t (width) * height));
    colours.push_back (std::make_unique<Rgbx[]> (std::size_t (width) * height));
    images.push_back ({view.view_id, view.roi, {depths.back ().get (), width, height, width * 2},
        {colours.back ().get (), width, height, width * 4}, 0});
  }
  if (!decoder.decode (images, 1, result).ok ())
    std::abort ();
  RigCollector collector;
  UnitReader units ({data, size});
  UnitHeader header;
  while (const auto unit = units.next (header))
    (void)collector.add (*unit).ok ();
  return 0;
}
