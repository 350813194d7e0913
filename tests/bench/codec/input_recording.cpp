/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Recorded files: the byte stream of docs/formats/bitstream.md, decoded. */
#include <fstream>
#include <iterator>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

#include "input.hpp"

using namespace rangecast;

namespace bench {
namespace {

class RecordingReader {
public:
  RecordingReader (std::string path, int skip, Input &input)
      : path_ (std::move (path)), skip_ (skip), input_ (input)
  {
  }

  /* Takes the units of an access unit. */
  Status take (std::span<const std::uint8_t> units)
  {
    number_++;
    if (Status s = take_rig (units); !s.ok ())
      return s;
    if (!rigs_.generation () || number_ <= skip_)
      return {}; /* nothing can be decoded before the rig is there */
    DecoderResult result;
    decoder_.plan (units, result);
    std::vector<Picture> pictures;
    std::vector<RangeImage> images;
    pictures.reserve (decoder_.views ().size ());
    for (const auto &planned : decoder_.views ()) {
      pictures.emplace_back (planned.roi.width, planned.roi.height);
      images.push_back (pictures.back ().image (planned.view_id, planned.roi));
    }
    if (Status s = decoder_.decode (images, 1, result); !s.ok ())
      return fail (s.message ());
    if (result.bad_slices || result.missing_pixels)
      return fail ("damaged or lossy, expected a recording with all slices");
    FrameSet set;
    for (std::size_t i = 0; i < images.size (); i++) {
      set.push_back (make_view (images[i].view_id, std::move (pictures[i])));
      set.back ().roi.x += images[i].roi.x;
      set.back ().roi.y += images[i].roi.y;
      if (set.back ().roi.empty ())
        set.pop_back ();
    }
    if (!set.empty ())
      input_.sets.push_back (std::move (set));
    return {};
  }

private:
  Status fail (const std::string &what) const
  {
    return {StatusCode::kBadData,
        "--recording " + path_ + ": frame set " + std::to_string (number_) + ": " + what};
  }

  Status take_rig (std::span<const std::uint8_t> units)
  {
    UnitReader reader (units);
    UnitHeader header;
    while (const auto unit = reader.next (header))
      if (header.type == static_cast<std::uint8_t> (UnitType::kRigView))
        if (Status s = rigs_.add (*unit); !s.ok ())
          return fail (s.message ());
    if (rigs_.generation () == generation_)
      return {};
    if (generation_)
      return fail ("another rig, expected the same cameras throughout");
    generation_ = rigs_.generation ();
    input_.rig = rigs_.info ().rig;
    return decoder_.set_rig (input_.rig);
  }

  std::string path_;
  int skip_;
  Input &input_;
  RigCollector rigs_;
  AccessUnitDecoder decoder_;
  unsigned generation_ = 0;
  int number_ = 0; /* of the frame set in the file, from 1 */
};

} // namespace

Status
load_recording (const std::string &path, int skip, int frames, Input &input)
{
  std::ifstream file (path, std::ios::binary);
  const std::vector<std::uint8_t> bytes{
      std::istreambuf_iterator<char> (file), std::istreambuf_iterator<char> ()};
  if (bytes.empty ())
    return {StatusCode::kNotFound,
        "--recording " + path + ": cannot be read, expected a neighbour code byte stream"};
  RecordingReader reader (path, skip, input);
  std::span<const std::uint8_t> rest = bytes;
  while (!rest.empty () && input.sets.size () < std::size_t (frames)) {
    const StreamPart part = next_part (rest, true);
    if (part.length)
      if (Status s = reader.take (
              rest.subspan (kAccessUnitHeaderSize, part.length - kAccessUnitHeaderSize));
          !s.ok ())
        return s;
    rest = rest.subspan (part.length ? part.length : part.garbage);
  }
  if (input.sets.empty ())
    return {StatusCode::kBadData,
        "--recording " + path +
            ": no frame set with pixels, expected a neighbour code byte stream"};
  input.name = path;
  return {};
}

} // namespace bench
