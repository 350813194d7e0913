/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "colour.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/overlap/colour_match.hpp>
#include <unordered_map>

using namespace rangecast;

namespace bench {

const char *
name_of (ColourError error)
{
  const char *const names[] = {"none", "gains", "light", "vignette"};
  return names[static_cast<std::size_t> (error)];
}

namespace {

constexpr double kNoise = 1;                      ///< of the pictures, grey levels
constexpr double kMaxError = 0.1;                 ///< of a gain
constexpr double kCorner = 0.2;                   ///< what vignetting takes in the corners
constexpr double kDefaultWidth = 0.02;            ///< of the blend, metres
constexpr int kFrames = 20;                       ///< that the balance learns from
constexpr double kSeam = 0.004, kNearSeam = 0.01; ///< metres

using Factors = std::array<double, 3>;

/* Up to 10 % each way for each view and channel; the mean of the logarithms is 0, as no method can
 * know which camera is right. */
std::vector<Factors>
factors_of (std::size_t views)
{
  cv::RNG random (3);
  std::vector<Factors> logs (views);
  Factors mean{};
  for (Factors &f : logs)
    for (std::size_t c = 0; c < 3; c++)
      mean[c] += (f[c] = random.uniform (-kMaxError, kMaxError)) / double (views);
  for (Factors &f : logs)
    for (std::size_t c = 0; c < 3; c++)
      f[c] = std::exp (f[c] - mean[c]);
  return logs;
}

double
to_light (double v)
{
  return v <= 0.04045 ? v / 12.92 : std::pow ((v + 0.055) / 1.055, 2.4);
}
double
from_light (double v)
{
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow (v, 1 / 2.4) - 0.055;
}

void
spoil (FrameSet &set, ColourError error)
{
  if (error == ColourError::kNone)
    return;
  const std::vector<Factors> factors = factors_of (set.rig.views.size ());
  for (std::size_t i = 0; i < set.colour.size (); i++) {
    const View &view = set.rig.views[i];
    for (std::size_t k = 0; k < set.colour[i].size (); k++) {
      const double x = (double (k % std::size_t (view.width)) * 2 / view.width - 1),
                   y = (double (k / std::size_t (view.width)) * 2 / view.height - 1);
      const double vignette =
          error == ColourError::kVignette ? 1 - kCorner * (x * x + y * y) / 2 : 1;
      Rgbx &pixel = set.colour[i][k];
      std::uint8_t *values[] = {&pixel.r, &pixel.g, &pixel.b};
      for (std::size_t c = 0; c < 3; c++) {
        double v = *values[c] / 255.0;
        if (error == ColourError::kLight)
          v = from_light (factors[i][c] * to_light (v));
        else
          v *= factors[i][c] * vignette;
        *values[c] = std::uint8_t (std::lround (255 * std::clamp (v, 0.0, 1.0)));
      }
    }
  }
  set.fresh_colour = set.colour;
}

double
psnr (double squares, std::size_t points)
{
  const double mean = squares / double (std::max<std::size_t> (1, 3 * points));
  return 10 * std::log10 (255 * 255 / std::max (mean, 1e-6));
}

/* Error of each channel of a point's colour. */
Factors
error_of (const Head &head, const Spot &spot)
{
  const auto i = std::size_t (spot.view);
  const std::size_t at =
      std::size_t (spot.v) * std::size_t (head.rig.views[i].width) + std::size_t (spot.u);
  const Rgbx is = head.set.colour[i][at], truth = head.colour[i][at];
  return {double (is.r) - truth.r, double (is.g) - truth.g, double (is.b) - truth.b};
}

/* The nearest point of another view, and how far that is. */
class Neighbours {
public:
  explicit Neighbours (const std::vector<Spot> &spots)
  {
    for (const Spot &spot : spots)
      cells_[key (spot.point, 13)].push_back (&spot);
  }
  const Spot *of (const Spot &spot, double &distance) const
  {
    const Spot *nearest = nullptr;
    distance = kNearSeam;
    for (int k = 0; k < 27; k++)
      if (const auto found = cells_.find (key (spot.point, k)); found != cells_.end ())
        for (const Spot *other : found->second)
          if (other->view != spot.view && norm (other->point - spot.point) < distance) {
            distance = norm (other->point - spot.point);
            nearest = other;
          }
    return nearest;
  }

private:
  static std::uint64_t key (Vec3 p, int k)
  {
    const auto part = [] (double v, int d) {
      return std::uint64_t (std::floor (v / kNearSeam) + (1 << 20) + d);
    };
    return part (p.x, k % 3 - 1) << 42 | part (p.y, k / 3 % 3 - 1) << 21 | part (p.z, k / 9 - 1);
  }
  std::unordered_map<std::uint64_t, std::vector<const Spot *>> cells_;
};

/* Steps in colour from the points of one view to those of another beside them, averaged over
 * patches before their size is taken: texture, which differs from point to point, goes, and the
 * edge that an eye would see along the seam stays. */
class Seams {
public:
  void add (const Spot &a, const Rgbx &of_a, const Spot &b, const Rgbx &of_b)
  {
    if (a.view > b.view)
      return; /* comes again the other way round */
    const auto part = [] (double v) {
      return std::uint64_t (std::floor (v / kPatch) + (1 << 18)) & 0x7ffff;
    };
    Patch &patch = patches_[{part (a.point.x) << 38 | part (a.point.y) << 19 | part (a.point.z),
        a.view * kMaxViews + b.view}];
    patch.n++;
    patch.step[0] += of_a.r - of_b.r;
    patch.step[1] += of_a.g - of_b.g;
    patch.step[2] += of_a.b - of_b.b;
  }
  [[nodiscard]] double mean () const
  {
    double sum = 0, n = 0;
    for (const auto &[key, patch] : patches_)
      if (patch.n >= kFewest)
        for (double step : patch.step)
          sum += std::abs (step), n += patch.n;
    return n > 0 ? sum / n : 0;
  }

private:
  static constexpr double kPatch = 0.02; ///< metres
  static constexpr int kFewest = 8;
  struct Patch {
    int n = 0;
    double step[3] = {};
  };
  std::map<std::pair<std::uint64_t, int>, Patch> patches_;
};

void
judge (Head &head, ColourRow &row)
{
  const std::vector<Spot> spots = spots_of (head.set);
  const Neighbours neighbours (spots);
  const auto colour_of = [&] (const Spot &spot) {
    const auto i = std::size_t (spot.view);
    return head.set.colour[i][std::size_t (spot.v) * std::size_t (head.rig.views[i].width) +
                              std::size_t (spot.u)];
  };
  double all = 0, near = 0;
  std::size_t n_near = 0;
  Seams seams;
  for (const Spot &spot : spots) {
    const Factors e = error_of (head, spot);
    const double square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    all += square;
    double distance;
    const Spot *other = neighbours.of (spot, distance);
    if (!other)
      continue;
    near += square, n_near++;
    if (distance < kSeam) {
      seams.add (spot, colour_of (spot), *other, colour_of (*other));
      seams.add (*other, colour_of (*other), spot, colour_of (spot));
    }
  }
  row.psnr_db = psnr (all, spots.size ());
  row.seam_psnr_db = psnr (near, n_near);
  row.seam_levels = seams.mean ();
}

struct Way {
  const char *name;
  ColourSettings settings;
};

double
ms_since (std::chrono::steady_clock::time_point begin)
{
  return std::chrono::duration<double, std::milli> (std::chrono::steady_clock::now () - begin)
      .count ();
}

double
median (std::vector<double> values)
{
  std::ranges::nth_element (values, values.begin () + std::ptrdiff_t (values.size () / 2));
  return values[values.size () / 2];
}

/* Some frames, so that the balance has learnt. */
Status
run_way (Head &head, const Way &way, const CylinderSettings &settings, ColourRow &row)
{
  ColourMatch match;
  CylinderFilter filter;
  if (Status s = filter.set_rig (head.set.rig); !s.ok ())
    return s;
  if (Status s = match.set_rig (head.set.rig); !s.ok ())
    return s;
  std::vector<double> balance, clear, blend;
  for (int frame = 0; frame < kFrames; frame++) {
    head.set.restore ();
    CylinderResult result;
    const std::vector<RangeImage> images = head.set.images_in_boxes ();
    auto begin = std::chrono::steady_clock::now ();
    const auto lap = [&] (std::vector<double> &times) {
      times.push_back (ms_since (begin));
      begin = std::chrono::steady_clock::now ();
    };
    Status s = match.before (images, way.settings);
    lap (balance);
    if (s.ok ())
      s = filter.process (images, settings, result);
    lap (clear);
    if (s.ok ())
      s = match.after (images, way.settings);
    lap (blend);
    if (!s.ok ())
      return s;
  }
  row.balance_ms = median (balance);
  row.filter_ms = median (clear);
  row.blend_ms = median (blend);
  return {};
}

std::vector<Way>
ways_of (const ColourJob &job)
{
  const double width = job.width_m > 0 ? job.width_m : kDefaultWidth;
  return {{"winner", {false, 0, 1}}, {"winner, balance", {true, 0, 1}},
      {"blend", {false, width, 1}}, {"blend, balance", {true, width, 1}}};
}

void
print_row (const ColourRow &r)
{
  char scene[80];
  std::snprintf (scene, sizeof scene, "%s, %d views, %s, %g mm %g deg, %s", r.scene.c_str (),
      r.views, r.noise.c_str (), r.pose_mm, r.pose_deg, r.error.c_str ());
  std::printf ("%-44s %-18s %8.2f %9.2f %9.2f %8.2f %8.2f %8.2f\n", scene, r.method.c_str (),
      r.psnr_db, r.seam_levels, r.seam_psnr_db, r.balance_ms, r.filter_ms, r.blend_ms);
  std::fflush (stdout);
}

/* The poses that colours are measured with: right, and 2 mm off, unless the job says otherwise. */
std::vector<HeadSettings>
colour_heads (const ColourJob &job)
{
  std::vector<HeadSettings> heads = heads_of (job.truth);
  if (job.truth.pose_mm < 0 && job.truth.pose_deg < 0)
    std::erase_if (heads, [] (const HeadSettings &h) { return h.pose_mm > 2 || h.pose_deg > 0; });
  if (!job.truth.noise)
    std::erase_if (heads, [] (const HeadSettings &h) { return h.noise == DepthNoise::kSmooth; });
  for (HeadSettings &h : heads)
    h.colour_noise = kNoise;
  return heads;
}

} // namespace

Status
run_colour (const ColourJob &job, std::vector<ColourRow> &rows)
{
  std::printf ("%-44s %-18s %8s %9s %9s %8s %8s %8s\n", "scene", "method", "PSNR dB", "seam step",
      "seam dB", "bal. ms", "filt. ms", "blend ms");
  for (const HeadSettings &settings : colour_heads (job)) {
    Head head;
    if (Status s = make_head (settings, head); !s.ok ())
      return s;
    const auto clean = head.set.colour;
    for (ColourError error :
        {ColourError::kNone, ColourError::kGains, ColourError::kLight, ColourError::kVignette}) {
      head.set.colour = clean;
      spoil (head.set, error);
      for (const Way &way : ways_of (job)) {
        ColourRow row;
        row.scene = settings.model.empty () ? "figure" : "head";
        row.noise = name_of (settings.noise);
        row.error = name_of (error);
        row.method = way.name;
        row.views = settings.views;
        row.pose_mm = settings.pose_mm;
        row.pose_deg = settings.pose_deg;
        if (Status s = run_way (head, way, job.truth.settings, row); !s.ok ())
          return s;
        judge (head, row);
        print_row (row);
        rows.push_back (row);
      }
    }
  }
  return {};
}

Status
write_json (const std::string &path, const std::vector<ColourRow> &rows)
{
  const Status failed = {
      StatusCode::kNotFound, "--json " + path + ": cannot be written, expected a file to write"};
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return failed;
  std::fputs ("[", file);
  for (std::size_t i = 0; i < rows.size (); i++) {
    const ColourRow &r = rows[i];
    std::fprintf (file,
        "%s\n{\"scene\": \"%s\", \"views\": %d, \"noise\": \"%s\", \"pose_mm\": %g, "
        "\"pose_deg\": %g, \"error\": \"%s\", \"method\": \"%s\", \"psnr_db\": %.4f, "
        "\"seam_levels\": %.4f, \"seam_psnr_db\": %.4f, \"balance_ms\": %.4f, "
        "\"filter_ms\": %.4f, \"blend_ms\": %.4f}",
        i ? "," : "", r.scene.c_str (), r.views, r.noise.c_str (), r.pose_mm, r.pose_deg,
        r.error.c_str (), r.method.c_str (), r.psnr_db, r.seam_levels, r.seam_psnr_db, r.balance_ms,
        r.filter_ms, r.blend_ms);
  }
  std::fputs ("\n]\n", file);
  const bool written = !std::ferror (file);
  return std::fclose (file) == 0 && written ? Status{} : failed;
}

namespace {

constexpr int kSide = 480;

/* Points as squares of the size that they have on the surface, nearest first. */
cv::Mat
paint (FrameSet &set, double turn_rad)
{
  cv::Mat picture (kSide, kSide, CV_8UC3, cv::Scalar (255, 255, 255));
  cv::Mat nearest (kSide, kSide, CV_64F, cv::Scalar (1e9));
  const double s = std::sin (turn_rad), c = std::cos (turn_rad), distance = 0.8;
  const double focal = 1.75 * kSide;
  for (const Spot &spot : spots_of (set)) {
    const Vec3 p = spot.point;
    const double z = distance - (s * p.x + c * p.z), half = focal / z * 0.0017;
    const double x = kSide / 2.0 + focal * (c * p.x - s * p.z) / z,
                 y = kSide / 2.0 - focal * (p.y - 0.025) / z;
    const auto i = std::size_t (spot.view);
    const Rgbx pixel = set.colour[i][std::size_t (spot.v) * std::size_t (set.rig.views[i].width) +
                                     std::size_t (spot.u)];
    for (int v = int (std::ceil (y - half)); v <= y + half; v++)
      for (int u = int (std::ceil (x - half)); u <= x + half; u++)
        if (u >= 0 && v >= 0 && u < kSide && v < kSide && z < nearest.at<double> (v, u)) {
          nearest.at<double> (v, u) = z;
          picture.at<cv::Vec3b> (v, u) = {pixel.b, pixel.g, pixel.r};
        }
  }
  return picture;
}

} // namespace

Status
draw_colours (const ColourJob &job, const std::string &path)
{
  Head head;
  if (Status s = make_head (colour_heads (job)[0], head); !s.ok ())
    return s;
  spoil (head.set, ColourError::kVignette);
  cv::Mat picture (kSide, 3 * kSide, CV_8UC3);
  int left = 0;
  const std::vector<Way> ways = ways_of (job);
  for (std::size_t i : {0, 1, 3}) {
    ColourRow row;
    if (Status s = run_way (head, ways[i], job.truth.settings, row); !s.ok ())
      return s;
    paint (head.set, M_PI / double (head.rig.views.size ()))
        .copyTo (picture.colRange (left, left + kSide));
    left += kSide;
  }
  try {
    if (cv::imwrite (path, picture, {cv::IMWRITE_PNG_COMPRESSION, 9, cv::IMWRITE_JPEG_QUALITY, 90}))
      return {};
  } catch (const cv::Exception &) { /* no such kind of picture */
  }
  return {StatusCode::kBadValue, "--picture " + path + ": cannot be written, expected FILE.png"};
}

} // namespace bench
