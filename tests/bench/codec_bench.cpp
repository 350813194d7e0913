/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The neighbour code beside RVL + JPEG on the same pixels in the same run.
 *
 * usage: codec_bench [--model FILE] [--size WxH] [--rounds N]
 *        codec_bench --color FILE --depth FILE [--color FILE --depth FILE ...]
 *                    [--depth-unit METRES] [--near METRES] [--far METRES] [--rounds N]
 * Four views of avatartestsrc's figure (or of a model), cut to the person; or pictures from files,
 * black where there is no depth. Times are medians over all rounds, for all views together, one
 * thread. "of peer" is the size beside RVL + JPEG at the same colour PSNR, interpolated.
 *
 * RVL is A. D. Wilson's lossless depth code ("Fast lossless depth image compression", ISS 2017),
 * written here from its description: runs of zeros and of values, zigzag differences, in nibbles of
 * three bits and a continuation bit. */
#include <turbojpeg.h>
#include <zstd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <opencv2/imgcodecs.hpp>
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

struct Row {
  std::string name;
  std::size_t bytes, points;
  double raw_bytes; ///< 0: not known
  Quality quality;
  double encode_ms, decode_ms;
};

/* Bytes of the peer at this PSNR, between the two of its rows that enclose it; 0: there are none.
 */
double
bytes_at (const std::vector<Row> &peer, double psnr_db)
{
  for (std::size_t i = 1; i < peer.size (); i++) {
    const Row &a = peer[i - 1], &b = peer[i];
    if (psnr_db < a.quality.psnr_db || psnr_db > b.quality.psnr_db)
      continue;
    const double part = (psnr_db - a.quality.psnr_db) / (b.quality.psnr_db - a.quality.psnr_db);
    return double (a.bytes) + part * (double (b.bytes) - double (a.bytes));
  }
  return 0;
}

std::string
percent (double part, double whole)
{
  char text[16] = "-";
  if (whole > 0)
    std::snprintf (text, sizeof text, "%.1f %%", 100 * part / whole);
  return text;
}

void
print (const Row &row, const std::vector<Row> &peer)
{
  std::printf ("%-34s %8zu %6.2f %8s %8s %7.2f %8.2f %8.2f %8.2f %8.2f\n", row.name.c_str (),
      row.bytes, 8.0 * double (row.bytes) / double (row.points),
      percent (double (row.bytes), row.raw_bytes).c_str (),
      percent (double (row.bytes), bytes_at (peer, row.quality.psnr_db)).c_str (),
      row.quality.psnr_db, row.quality.depth_rms_mm, row.quality.depth_max_mm, row.encode_ms,
      row.decode_ms);
}

const char *const kProfileNames[] = {"plain", "packed", "entropy"};

Row
run_profile (
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
  DecoderResult decoded_result;
  const double decode = median_ms (rounds, [&] {
    decoded_result = {};
    decoder.plan (bytes, decoded_result);
    if (!decoder.decode (outputs, 1, decoded_result).ok ())
      std::abort ();
  });
  if (decoded_result.bad_slices || decoded_result.points != result.points)
    std::abort ();
  const std::string name = std::string (kProfileNames[static_cast<int> (settings.profile)]) +
                           (settings.choice == NeighbourChoice::kBest ? " best" : "") + " d" +
                           std::to_string (settings.depth_bits) + "/" +
                           std::to_string (settings.depth_threshold) + " c" +
                           std::to_string (settings.colour_bits) + "/" +
                           std::to_string (settings.colour_threshold) +
                           (settings.max_slice_size > 1200 ? " long slices" : "");
  return {name, bytes.size (), result.points, double (result.raw_bits) / 8,
      compare (pictures, decoded, rig.views[0].depth_unit_m), encode, decode};
}

/* Packs RVL's bytes once more. @return how many there are then */
std::size_t
compress (const std::vector<std::uint8_t> &from, std::vector<std::uint8_t> &to)
{
  to.resize (ZSTD_compressBound (from.size ()));
  return ZSTD_compress (to.data (), to.size (), from.data (), from.size (), 1);
}

void
expand (const std::vector<std::uint8_t> &from, std::size_t size, std::vector<std::uint8_t> &to)
{
  ZSTD_decompress (to.data (), to.size (), from.data (), size);
}

Row
run_rvl_jpeg (
    const Rig &rig, std::vector<Picture> &pictures, int quality, bool with_zstd, int rounds)
{
  const tjhandle compressor = tjInitCompress (), expander = tjInitDecompress ();
  std::vector<Picture> decoded = pictures;
  const std::size_t n = pictures.size ();
  std::vector<std::vector<std::uint8_t>> depth (n), packed (n);
  std::vector<std::size_t> packed_size (n);
  std::vector<unsigned char *> jpeg (n);
  std::vector<unsigned long> jpeg_size (n), most (n);
  for (std::size_t i = 0; i < n; i++) {
    most[i] = tjBufSize (pictures[i].width, pictures[i].height, TJSAMP_420);
    jpeg[i] = tjAlloc (int (most[i]));
  }
  const double encode = median_ms (rounds, [&] {
    for (std::size_t i = 0; i < n; i++) {
      Rvl::encode (pictures[i].depth, depth[i]);
      packed_size[i] = with_zstd ? compress (depth[i], packed[i]) : depth[i].size ();
      jpeg_size[i] = most[i];
      tjCompress2 (compressor, &pictures[i].colour[0].r, pictures[i].width, 0, pictures[i].height,
          TJPF_RGBX, &jpeg[i], &jpeg_size[i], TJSAMP_420, quality,
          TJFLAG_FASTDCT | TJFLAG_NOREALLOC);
    }
  });
  const double decode = median_ms (rounds, [&] {
    for (std::size_t i = 0; i < n; i++) {
      if (with_zstd)
        expand (packed[i], packed_size[i], depth[i]);
      Rvl::decode (depth[i], decoded[i].depth);
      tjDecompress2 (expander, jpeg[i], jpeg_size[i], &decoded[i].colour[0].r, decoded[i].width, 0,
          decoded[i].height, TJPF_RGBX, TJFLAG_FASTDCT);
    }
  });
  std::size_t bytes = 0, points = 0;
  for (std::size_t i = 0; i < n; i++) {
    bytes += packed_size[i] + jpeg_size[i];
    points += pictures[i].depth.size () -
              std::size_t (std::ranges::count (pictures[i].depth, std::uint16_t{0}));
    tjFree (jpeg[i]);
  }
  tjDestroy (compressor);
  tjDestroy (expander);
  return {std::string (with_zstd ? "RVL + zstd + JPEG" : "RVL + JPEG") + " 4:2:0 q" +
              std::to_string (quality),
      bytes, points, 0, compare (pictures, decoded, rig.views[0].depth_unit_m), encode, decode};
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

/* What to measure, and with which cameras. */
struct Job {
  Rig rig;
  std::vector<Picture> pictures;
};

bool
render_job (const SceneSettings &settings, Job &job)
{
  std::unique_ptr<Scene> scene;
  if (const Status status = Scene::create (settings, scene); !status.ok ()) {
    std::fprintf (stderr, "codec_bench: %s\n", status.message ().c_str ());
    return false;
  }
  for (View view : scene->rig ().views) {
    view.right.reset ();
    view.third.reset ();
    job.rig.views.push_back (view);
  }
  job.pictures = render (*scene, settings.width, settings.height);
  return true;
}

struct Files {
  std::vector<std::string> colour, depth;
  double depth_unit_m = 0.001, near_m = 0.3, far_m = 8;
};

bool
load_job (const Files &files, Job &job)
{
  for (std::size_t i = 0; i < files.colour.size (); i++) {
    const cv::Mat colour = cv::imread (files.colour[i], cv::IMREAD_COLOR);
    const cv::Mat depth = cv::imread (files.depth[i], cv::IMREAD_UNCHANGED);
    if (colour.empty () || depth.type () != CV_16UC1 || depth.size () != colour.size ()) {
      std::fprintf (stderr, "codec_bench: %s, %s: expected colour and 16-bit depth of one size\n",
          files.colour[i].c_str (), files.depth[i].c_str ());
      return false;
    }
    View view;
    view.id = int (i);
    view.width = depth.cols;
    view.height = depth.rows;
    view.intrinsics = {
        double (depth.cols), double (depth.cols), depth.cols / 2.0, depth.rows / 2.0};
    view.depth_unit_m = files.depth_unit_m;
    view.near_m = files.near_m;
    view.far_m = files.far_m;
    job.rig.views.push_back (view);
    Picture p{depth.cols, depth.rows, view.id, {}, {}};
    for (int y = 0; y < depth.rows; y++)
      for (int x = 0; x < depth.cols; x++) {
        std::uint16_t d = depth.at<std::uint16_t> (y, x);
        if (d * view.depth_unit_m < view.near_m || d * view.depth_unit_m > view.far_m)
          d = 0;
        const auto &c = colour.at<cv::Vec3b> (y, x);
        p.depth.push_back (d);
        p.colour.push_back (d ? Rgbx{c[2], c[1], c[0], 0} : Rgbx{});
      }
    job.pictures.push_back (cut (p, bounding_box (p.image (), 0)));
  }
  return true;
}

void
run (Job &job, int rounds)
{
  std::printf ("%-34s %8s %6s %8s %8s %7s %8s %8s %8s %8s\n", "all views", "bytes", "bpvp",
      "of raw", "of peer", "dB", "rms mm", "max mm", "enc ms", "dec ms");
  std::vector<Row> peer;
  for (int quality : {20, 30, 40, 50, 60, 70, 75, 80, 85, 90, 95})
    print (peer.emplace_back (run_rvl_jpeg (job.rig, job.pictures, quality, false, rounds)), {});
  for (int quality : {50, 75})
    print (run_rvl_jpeg (job.rig, job.pictures, quality, true, rounds), peer);
  const auto mine = [&] (const EncoderSettings &settings) {
    print (run_profile (job.rig, job.pictures, settings, rounds), peer);
  };
  /* Depth thresholds that make an error of about 0.4, 0.9, 1.3 mm, whatever a code is. */
  DepthQuantiser exact;
  if (!exact.set (job.rig.views[0], 16).ok ())
    std::abort ();
  const double code_mm = exact.step () * job.rig.views[0].depth_unit_m * 1000;
  for (Profile profile : {Profile::kPlain, Profile::kPacked, Profile::kEntropy}) {
    for (double depth_mm : {0.8, 1.6, 2.4})
      for (int colour : {5, 7, 9, 11, 13, 16})
        mine ({16, 8, int (depth_mm / code_mm + 0.01), colour, 1200, profile});
    for (int colour : {7, 9, 13})
      if (profile != Profile::kPlain)
        mine ({16, 8, int (1.6 / code_mm + 0.01), colour, 1200, profile, NeighbourChoice::kBest});
    mine ({16, 8, 0, 0, 1200, profile});
    mine ({12, 8, 8, 10, 1200, profile});
    mine ({12, 8, 8, 10, 65535, profile});
  }
}

} // namespace

int
main (int argc, char **argv)
{
  SceneSettings settings;
  settings.noise_sigma = 1.5;
  Files files;
  int rounds = 31;
  for (int i = 1; i < argc; i += 2) {
    const std::string option = argv[i], value = i + 1 < argc ? argv[i + 1] : "";
    if (option == "--model" && i + 1 < argc)
      settings.model = value;
    else if (option == "--rounds" && i + 1 < argc)
      rounds = std::max (1, std::atoi (value.c_str ()));
    else if (option == "--size" && i + 1 < argc)
      std::sscanf (value.c_str (), "%dx%d", &settings.width, &settings.height);
    else if (option == "--color" && i + 1 < argc)
      files.colour.push_back (value);
    else if (option == "--depth" && i + 1 < argc)
      files.depth.push_back (value);
    else if (option == "--depth-unit" && i + 1 < argc)
      files.depth_unit_m = std::atof (value.c_str ());
    else if (option == "--near" && i + 1 < argc)
      files.near_m = std::atof (value.c_str ());
    else if (option == "--far" && i + 1 < argc)
      files.far_m = std::atof (value.c_str ());
    else {
      std::fprintf (stderr,
          "usage: codec_bench [--model FILE] [--size WxH] [--rounds N]\n"
          "       codec_bench --color FILE --depth FILE ... [--depth-unit METRES] [--near METRES]\n"
          "                   [--far METRES] [--rounds N]\n");
      return 2;
    }
  }
  Job job;
  const bool ready = files.colour.empty () && files.depth.empty ()
                         ? render_job (settings, job)
                         : files.colour.size () == files.depth.size () && load_job (files, job);
  if (!ready)
    return 1;
  run (job, rounds);
  return 0;
}
