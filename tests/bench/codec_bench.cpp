/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The neighbour code beside RVL + JPEG on the same pixels in the same run.
 *
 * usage: codec_bench [--model FILE] [--size WxH] [--rounds N]
 * Four views of avatartestsrc's figure (or of a model), cut to the person. Times are medians over
 * all rounds, for all views together, one thread.
 *
 * RVL is A. D. Wilson's lossless depth code ("Fast lossless depth image compression", ISS 2017),
 * written here from its description: runs of zeros and of values, zigzag differences, in nibbles of
 * three bits and a continuation bit. */
#include <turbojpeg.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <rangecast/roi/bounding_box.hpp>
#include <rangecast/scene/scene.hpp>
#include <string>
#include <vector>

using namespace rangecast;

namespace {

struct Picture {
  int width, height, view_id;
  std::vector<std::uint16_t> depth;
  std::vector<Rgbx> colour;
  RangeImage image ()
  {
    return {view_id, {0, 0, width, height}, {depth.data (), width, height, width * 2},
        {colour.data (), width, height, width * 4}, 0};
  }
};

double
median_ms (int rounds, const std::function<void ()> &work)
{
  std::vector<double> times;
  for (int i = 0; i < rounds; i++) {
    const auto begin = std::chrono::steady_clock::now ();
    work ();
    times.push_back (
        std::chrono::duration<double, std::milli> (std::chrono::steady_clock::now () - begin)
            .count ());
  }
  std::ranges::nth_element (times, times.begin () + rounds / 2);
  return times[rounds / 2];
}

/* Nibbles: three bits of a number, then whether more follow; first nibble in the high half. */
class Rvl {
public:
  static void encode (const std::vector<std::uint16_t> &depth, std::vector<std::uint8_t> &to)
  {
    Rvl rvl;
    to.clear ();
    int previous = 0;
    for (std::size_t i = 0; i < depth.size ();) {
      std::size_t zeros = i;
      while (zeros < depth.size () && !depth[zeros])
        zeros++;
      rvl.put (to, unsigned (zeros - i));
      std::size_t end = zeros;
      while (end < depth.size () && depth[end])
        end++;
      rvl.put (to, unsigned (end - zeros));
      for (i = zeros; i < end; i++) {
        const int delta = depth[i] - previous;
        rvl.put (to, unsigned (delta << 1 ^ delta >> 31));
        previous = depth[i];
      }
    }
    if (rvl.half_)
      to.push_back (rvl.held_);
  }
  static void decode (const std::vector<std::uint8_t> &from, std::vector<std::uint16_t> &depth)
  {
    Rvl rvl;
    int previous = 0;
    for (std::size_t i = 0; i < depth.size ();) {
      for (unsigned n = rvl.get (from); n > 0; n--)
        depth[i++] = 0;
      for (unsigned n = rvl.get (from); n > 0; n--) {
        const unsigned z = rvl.get (from);
        previous += int (z >> 1) ^ -int (z & 1);
        depth[i++] = std::uint16_t (previous);
      }
    }
  }

private:
  void put (std::vector<std::uint8_t> &to, unsigned value)
  {
    do {
      const unsigned nibble = (value & 7) | (value > 7 ? 8 : 0);
      value >>= 3;
      if (half_)
        to.push_back (std::uint8_t (held_ | nibble));
      else
        held_ = std::uint8_t (nibble << 4);
      half_ = !half_;
    } while (value);
  }
  unsigned get (const std::vector<std::uint8_t> &from)
  {
    unsigned value = 0;
    for (int shift = 0;; shift += 3) {
      const unsigned nibble = half_ ? from[position_++] & 15 : from[position_] >> 4;
      half_ = !half_;
      value |= (nibble & 7) << shift;
      if (!(nibble & 8))
        return value;
    }
  }
  bool half_ = false;
  std::uint8_t held_ = 0;
  std::size_t position_ = 0;
};

struct Quality {
  double psnr_db, depth_rms_mm, depth_max_mm;
};

Quality
compare (const std::vector<Picture> &a, const std::vector<Picture> &b, double unit_m)
{
  double colour = 0, depth = 0, most = 0;
  std::size_t n = 0;
  for (std::size_t v = 0; v < a.size (); v++)
    for (std::size_t i = 0; i < a[v].depth.size (); i++) {
      if (!a[v].depth[i])
        continue;
      const Rgbx p = a[v].colour[i], q = b[v].colour[i];
      colour += (p.r - q.r) * (p.r - q.r) + (p.g - q.g) * (p.g - q.g) + (p.b - q.b) * (p.b - q.b);
      const double d = std::abs (int (a[v].depth[i]) - int (b[v].depth[i])) * unit_m * 1000;
      depth += d * d;
      most = std::max (most, d);
      n++;
    }
  return {10 * std::log10 (255.0 * 255 * 3 * double (n) / std::max (colour, 1e-9)),
      std::sqrt (depth / double (n)), most};
}

void
print_row (const std::string &name, std::size_t bytes, std::size_t points, double raw_bytes,
    const Quality &q, double encode, double decode)
{
  std::printf ("%-34s %8zu %6.2f %8s %7.1f %8.2f %8.2f %8.2f %8.2f\n", name.c_str (), bytes,
      8.0 * double (bytes) / double (points),
      raw_bytes > 0
          ? (std::to_string (int (1000 * double (bytes) / raw_bytes) / 10.0).substr (0, 4) + " %")
                .c_str ()
          : "-",
      q.psnr_db, q.depth_rms_mm, q.depth_max_mm, encode, decode);
}

void
run_plain (
    const Rig &rig, std::vector<Picture> &pictures, const EncoderSettings &settings, int rounds)
{
  AccessUnitEncoder encoder;
  AccessUnitDecoder decoder;
  if (!encoder.configure (rig, settings).ok () || !decoder.set_rig (rig).ok ())
    std::abort ();
  std::vector<RangeImage> images;
  std::vector<Picture> decoded = pictures;
  std::vector<RangeImage> outputs;
  for (std::size_t i = 0; i < pictures.size (); i++) {
    images.push_back (pictures[i].image ());
    outputs.push_back (decoded[i].image ());
  }
  EncoderResult result;
  const double encode = median_ms (rounds, [&] {
    result = {};
    if (!encoder.encode (images, 1, 1, result).ok ())
      std::abort ();
  });
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < encoder.parts (); i++)
    bytes.insert (bytes.end (), encoder.part (i).begin (), encoder.part (i).end ());
  const double decode = median_ms (rounds, [&] {
    DecoderResult r;
    decoder.plan (bytes, r);
    if (!decoder.decode (outputs, 1, r).ok ())
      std::abort ();
  });
  const std::string name = "plain d" + std::to_string (settings.depth_bits) + "/" +
                           std::to_string (settings.depth_threshold) + " c" +
                           std::to_string (settings.colour_bits) + "/" +
                           std::to_string (settings.colour_threshold);
  print_row (name, bytes.size (), result.points, double (result.raw_bits) / 8,
      compare (pictures, decoded, rig.views[0].depth_unit_m), encode, decode);
}

void
run_rvl_jpeg (const Rig &rig, std::vector<Picture> &pictures, int quality, int rounds)
{
  const tjhandle compressor = tjInitCompress (), expander = tjInitDecompress ();
  std::vector<Picture> decoded = pictures;
  std::vector<std::vector<std::uint8_t>> depth (pictures.size ());
  std::vector<unsigned char *> jpeg (pictures.size ());
  std::vector<unsigned long> jpeg_size (pictures.size ());
  std::vector<unsigned long> most (pictures.size ());
  for (std::size_t i = 0; i < jpeg.size (); i++) {
    most[i] = tjBufSize (pictures[i].width, pictures[i].height, TJSAMP_420);
    jpeg[i] = tjAlloc (int (most[i]));
  }
  const double encode = median_ms (rounds, [&] {
    for (std::size_t i = 0; i < pictures.size (); i++) {
      Rvl::encode (pictures[i].depth, depth[i]);
      jpeg_size[i] = most[i];
      tjCompress2 (compressor, &pictures[i].colour[0].r, pictures[i].width, 0, pictures[i].height,
          TJPF_RGBX, &jpeg[i], &jpeg_size[i], TJSAMP_420, quality,
          TJFLAG_FASTDCT | TJFLAG_NOREALLOC);
    }
  });
  const double decode = median_ms (rounds, [&] {
    for (std::size_t i = 0; i < pictures.size (); i++) {
      Rvl::decode (depth[i], decoded[i].depth);
      tjDecompress2 (expander, jpeg[i], jpeg_size[i], &decoded[i].colour[0].r, decoded[i].width, 0,
          decoded[i].height, TJPF_RGBX, TJFLAG_FASTDCT);
    }
  });
  std::size_t bytes = 0, points = 0;
  for (std::size_t i = 0; i < pictures.size (); i++) {
    bytes += depth[i].size () + jpeg_size[i];
    points += pictures[i].depth.size () -
              std::size_t (std::ranges::count (pictures[i].depth, std::uint16_t{0}));
    tjFree (jpeg[i]);
  }
  print_row ("RVL + JPEG 4:2:0 q" + std::to_string (quality), bytes, points, 0,
      compare (pictures, decoded, rig.views[0].depth_unit_m), encode, decode);
  tjDestroy (compressor);
  tjDestroy (expander);
}

Picture
cut (const Picture &from, const Roi &roi)
{
  Picture to{roi.width, roi.height, from.view_id, {}, {}};
  for (int y = roi.y; y < roi.y + roi.height; y++)
    for (int x = roi.x; x < roi.x + roi.width; x++) {
      to.depth.push_back (from.depth[std::size_t (y) * from.width + x]);
      to.colour.push_back (from.colour[std::size_t (y) * from.width + x]);
    }
  return to;
}

std::vector<Picture>
render (Scene &scene, int width, int height)
{
  std::vector<Picture> pictures;
  for (const View &view : scene.rig ().views) {
    Picture p{width, height, view.id, std::vector<std::uint16_t> (std::size_t (width) * height),
        std::vector<Rgbx> (std::size_t (width) * height)};
    const RangeImage image = p.image ();
    if (!scene.render (view.id, SceneCamera::kLeft, 0.5, false, image.colour, image.depth, {})
             .ok ())
      std::abort ();
    for (std::size_t i = 0; i < p.depth.size (); i++) /* both codes see the person on black */
      if (!p.depth[i])
        p.colour[i] = {};
    pictures.push_back (cut (p, bounding_box (image, 0)));
  }
  return pictures;
}

} // namespace

int
main (int argc, char **argv)
{
  SceneSettings settings;
  settings.noise_sigma = 1.5;
  int rounds = 31;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i];
    if (option == "--model")
      settings.model = argv[i + 1];
    else if (option == "--rounds")
      rounds = std::max (1, std::atoi (argv[i + 1]));
    else if (option == "--size")
      std::sscanf (argv[i + 1], "%dx%d", &settings.width, &settings.height);
    else {
      std::fprintf (stderr, "usage: codec_bench [--model FILE] [--size WxH] [--rounds N]\n");
      return 2;
    }
  }
  std::unique_ptr<Scene> scene;
  if (const Status status = Scene::create (settings, scene); !status.ok ()) {
    std::fprintf (stderr, "codec_bench: %s\n", status.message ().c_str ());
    return 1;
  }
  Rig rig;
  for (View view : scene->rig ().views) {
    view.right.reset ();
    view.third.reset ();
    rig.views.push_back (view);
  }
  std::vector<Picture> pictures = render (*scene, settings.width, settings.height);
  std::printf ("%-34s %8s %6s %8s %7s %8s %8s %8s %8s\n", "four views", "bytes", "bpvp", "of raw",
      "dB", "rms mm", "max mm", "enc ms", "dec ms");
  run_plain (rig, pictures, {16, 8, 0, 0, 1200}, rounds);
  for (int depth : {4, 8, 12, 16})
    for (int colour : {6, 8, 10, 12, 16})
      run_plain (rig, pictures, {12, 8, depth, colour, 1200}, rounds);
  for (int quality : {50, 75, 90})
    run_rvl_jpeg (rig, pictures, quality, rounds);
  return 0;
}
