/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The binary form of a rig; the layout is specified in docs/formats/rig.md. */
#include "rig.hpp"

#include <bit>
#include <cstring>

namespace rangecast {
namespace {

constexpr std::uint8_t kMagic[4] = {'R', 'C', 'R', 'G'};
constexpr std::uint8_t kVersion = 1;
constexpr std::uint8_t kHasRight = 1, kHasThird = 2;

class BlobWriter {
public:
  void u8 (std::uint8_t v) { bytes.push_back (v); }
  void u16 (std::uint16_t v)
  {
    u8 (v & 0xff);
    u8 (v >> 8);
  }
  void f64 (double v)
  {
    const auto bits = std::bit_cast<std::uint64_t> (v);
    for (int i = 0; i < 8; i++)
      u8 (bits >> (8 * i) & 0xff);
  }
  void text (const std::string &s)
  {
    u8 (static_cast<std::uint8_t> (s.size ()));
    bytes.insert (bytes.end (), s.begin (), s.end ());
  }
  std::vector<std::uint8_t> bytes;
};

/* Reads beyond the end return zeros and set failed. */
class BlobReader {
public:
  explicit BlobReader (std::span<const std::uint8_t> bytes) : bytes_ (bytes) {}
  std::uint8_t u8 ()
  {
    if (position_ >= bytes_.size ()) {
      failed = true;
      return 0;
    }
    return bytes_[position_++];
  }
  std::uint16_t u16 ()
  {
    const std::uint16_t low = u8 ();
    return static_cast<std::uint16_t> (low | u8 () << 8);
  }
  double f64 ()
  {
    std::uint64_t bits = 0;
    for (int i = 0; i < 8; i++)
      bits |= std::uint64_t{u8 ()} << (8 * i);
    return std::bit_cast<double> (bits);
  }
  std::string text ()
  {
    std::string s (u8 (), '\0');
    for (char &c : s)
      c = static_cast<char> (u8 ());
    return s;
  }
  [[nodiscard]] bool at_end () const { return position_ == bytes_.size (); }
  bool failed = false;

private:
  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
};

void
put_pose (BlobWriter &out, const Pose &pose)
{
  for (double v : pose.rotation)
    out.f64 (v);
  for (double v : {pose.translation.x, pose.translation.y, pose.translation.z})
    out.f64 (v);
}

Pose
get_pose (BlobReader &in)
{
  Pose pose;
  for (double &v : pose.rotation)
    v = in.f64 ();
  for (double *v : {&pose.translation.x, &pose.translation.y, &pose.translation.z})
    *v = in.f64 ();
  return pose;
}

void
put_lens (BlobWriter &out, const Intrinsics &k, const Distortion &distortion)
{
  for (double v : {k.fx, k.fy, k.cx, k.cy})
    out.f64 (v);
  out.u8 (static_cast<std::uint8_t> (distortion.size ()));
  for (double v : distortion)
    out.f64 (v);
}

void
get_lens (BlobReader &in, Intrinsics &k, Distortion &distortion)
{
  for (double *v : {&k.fx, &k.fy, &k.cx, &k.cy})
    *v = in.f64 ();
  distortion.resize (in.u8 ());
  for (double &v : distortion)
    v = in.f64 ();
}

void
put_partner (BlobWriter &out, const std::optional<PartnerCamera> &partner)
{
  if (!partner)
    return;
  put_lens (out, partner->intrinsics, partner->distortion);
  put_pose (out, partner->partner_from_left);
}

PartnerCamera
get_partner (BlobReader &in)
{
  PartnerCamera partner;
  get_lens (in, partner.intrinsics, partner.distortion);
  partner.partner_from_left = get_pose (in);
  return partner;
}

void
put_view (BlobWriter &out, const View &view)
{
  out.u8 (static_cast<std::uint8_t> (view.id));
  out.u8 ((view.right ? kHasRight : 0) | (view.third ? kHasThird : 0));
  out.text (view.name);
  out.u16 (static_cast<std::uint16_t> (view.width));
  out.u16 (static_cast<std::uint16_t> (view.height));
  put_lens (out, view.intrinsics, view.distortion);
  put_pose (out, view.world_from_view);
  for (double v : {view.depth_unit_m, view.near_m, view.far_m})
    out.f64 (v);
  put_partner (out, view.right);
  put_partner (out, view.third);
}

View
get_view (BlobReader &in)
{
  View view;
  view.id = in.u8 ();
  const std::uint8_t flags = in.u8 ();
  in.failed |= (flags & ~(kHasRight | kHasThird)) != 0;
  view.name = in.text ();
  view.width = in.u16 ();
  view.height = in.u16 ();
  get_lens (in, view.intrinsics, view.distortion);
  view.world_from_view = get_pose (in);
  for (double *v : {&view.depth_unit_m, &view.near_m, &view.far_m})
    *v = in.f64 ();
  if (flags & kHasRight)
    view.right = get_partner (in);
  if (flags & kHasThird)
    view.third = get_partner (in);
  return view;
}

} // namespace

std::vector<std::uint8_t>
encode_rig (const Rig &rig)
{
  BlobWriter out;
  for (std::uint8_t c : kMagic)
    out.u8 (c);
  out.u8 (kVersion);
  out.u8 (static_cast<std::uint8_t> (rig.views.size ()));
  for (const View &view : rig.views)
    put_view (out, view);
  return std::move (out.bytes);
}

Status
decode_rig (std::span<const std::uint8_t> blob, Rig &rig)
{
  if (blob.size () < 6)
    return {StatusCode::kTruncated, "rig blob: shorter than its header of 6 bytes"};
  if (std::memcmp (blob.data (), kMagic, sizeof kMagic) != 0)
    return {StatusCode::kBadData, "rig blob: does not begin with \"RCRG\""};
  if (blob[4] != kVersion)
    return {
        StatusCode::kUnsupported, "rig blob: version " + std::to_string (blob[4]) + " is unknown"};
  const int n_views = blob[5];
  if (n_views > kMaxViews)
    return {StatusCode::kBadData, "rig blob: " + std::to_string (n_views) + " views, at most 64"};
  BlobReader in (blob.subspan (6));
  Rig decoded;
  for (int i = 0; i < n_views && !in.failed; i++)
    decoded.views.push_back (get_view (in));
  if (in.failed)
    return {StatusCode::kTruncated, "rig blob: ends before its last view, or has unknown flags"};
  if (!in.at_end ())
    return {StatusCode::kBadData, "rig blob: bytes after its last view"};
  if (Status s = validate (decoded); !s.ok ())
    return {s.code () == StatusCode::kBadSize ? s.code () : StatusCode::kBadData,
        "rig blob: " + s.message ()};
  rig = std::move (decoded);
  return {};
}

} // namespace rangecast
