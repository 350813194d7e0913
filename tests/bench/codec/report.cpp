/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

using namespace rangecast;

namespace bench {
namespace {

/* The peer at some PSNR. */
struct PeerPoint {
  double bytes, encode_ms, decode_ms;
};

/* One peer at all its qualities. */
class PeerCurve {
public:
  PeerCurve (const std::vector<Row> &rows, const std::string &name)
  {
    for (const Row &row : rows)
      if (row.codec == name && std::isfinite (row.psnr_db))
        rows_.push_back (row);
    std::ranges::sort (rows_, {}, &Row::psnr_db);
  }

  /* Nothing beyond its lowest and highest quality. */
  [[nodiscard]] std::optional<PeerPoint> at (double psnr_db) const
  {
    for (std::size_t i = 0; i < rows_.size (); i++) {
      const Row &a = rows_[i > 0 ? i - 1 : 0], &b = rows_[i];
      if (psnr_db < a.psnr_db || psnr_db > b.psnr_db)
        continue;
      const double range = b.psnr_db - a.psnr_db;
      const double part = range > 0 ? (psnr_db - a.psnr_db) / range : 0;
      return PeerPoint{a.bytes * std::pow (b.bytes / a.bytes, part),
          a.encode_ms + part * (b.encode_ms - a.encode_ms),
          a.decode_ms + part * (b.decode_ms - a.decode_ms)};
    }
    return {};
  }

private:
  std::vector<Row> rows_;
};

std::string
text (const char *format, double value)
{
  char buffer[32];
  std::snprintf (buffer, sizeof buffer, format, value);
  return buffer;
}

/* How many times as fast, encoding and decoding. */
std::string
speed (const std::optional<PeerPoint> &peer, const Row &row)
{
  if (!peer)
    return "      -      -";
  return text ("%6.2fx", peer->encode_ms / row.encode_ms) +
         text ("%6.2fx", peer->decode_ms / row.decode_ms);
}

constexpr int kNameWidth = 66; /* columns */

void
print_heading ()
{
  std::printf ("%-*s %9s %6s %7s %7s %9s %9s %8s %8s   %s\n", kNameWidth, "", "", "", "colour",
      "size of", "depth", "error", "encode", "decode",
      "speed beside the peer at this PSNR, enc dec");
  std::printf ("%-*s %9s %6s %7s %7s %9s %9s %8s %8s  %14s  %14s\n", kNameWidth, "", "bytes",
      "bpvp", "PSNR dB", "peer", "rms mm", "max mm", "ms", "ms", "ROI", "whole picture");
}

void
print_row (const std::string &name, const Row &row, const PeerCurve &roi, const PeerCurve &whole)
{
  const auto of_roi = roi.at (row.psnr_db), of_whole = whole.at (row.psnr_db);
  std::printf ("  %-*s %9.0f %6.2f %7s %7s %9.2f %9.2f %8.3f %8.3f  %s  %s\n", kNameWidth - 2,
      name.c_str (), row.bytes, row.bpvp,
      std::isfinite (row.psnr_db) ? text ("%.2f", row.psnr_db).c_str () : "-",
      of_roi ? text ("%.1f %%", 100 * row.bytes / of_roi->bytes).c_str () : "-", row.depth_rms_mm,
      row.depth_max_mm, row.encode_ms, row.decode_ms, speed (of_roi, row).c_str (),
      speed (of_whole, row).c_str ());
}

std::string
quoted (const std::string &text)
{
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      out += '\\';
    out += c;
  }
  return out + "\"";
}

} // namespace

void
print_rows (const std::vector<Row> &rows)
{
  const PeerCurve roi (rows, name_of (kPeerName, false)), whole (rows, name_of (kPeerName, true));
  print_heading ();
  for (std::size_t i = 0; i < rows.size (); i++) {
    if (!i || rows[i].codec != rows[i - 1].codec)
      std::printf ("%s\n", rows[i].codec.c_str ());
    print_row (rows[i].settings, rows[i], roi, whole);
  }
}

void
print_choices (const std::vector<Row> &rows, double depth_rms_mm)
{
  const PeerCurve roi (rows, name_of (kPeerName, false)), whole (rows, name_of (kPeerName, true));
  for (const double psnr_db : {34.5, 36.0, 38.0}) {
    std::vector<const Row *> best; /* one of each codec */
    for (const Row &row : rows) {
      if (row.psnr_db < psnr_db || row.depth_rms_mm > depth_rms_mm)
        continue;
      const auto same =
          std::ranges::find_if (best, [&] (const Row *other) { return other->codec == row.codec; });
      if (same == best.end ())
        best.push_back (&row);
      else if (row.bytes < (*same)->bytes)
        *same = &row;
    }
    std::ranges::sort (best, {}, &Row::bytes);
    std::printf ("smallest of each with a colour PSNR of at least %g dB and a depth error of at "
                 "most %g mm rms\n",
        psnr_db, depth_rms_mm);
    for (const Row *row : best)
      print_row (row->codec + ": " + row->settings, *row, roi, whole);
  }
}

/* What to say of a file that cannot be written. */
static Status
not_writable (const std::string &path)
{
  return {
      StatusCode::kNotFound, "--json " + path + ": cannot be written, expected a file to write"};
}

Status
check_json (const std::string &path)
{
  std::FILE *file = std::fopen (path.c_str (), "a"); /* keeps what is in it */
  if (!file)
    return not_writable (path);
  std::fclose (file);
  return {};
}

Status
write_json (const std::string &path, const std::vector<Row> &rows)
{
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return not_writable (path);
  std::fputs ("[", file);
  for (std::size_t i = 0; i < rows.size (); i++) {
    const Row &r = rows[i];
    const std::string psnr = std::isfinite (r.psnr_db) ? text ("%.4f", r.psnr_db) : "null";
    std::fprintf (file,
        "%s\n{\"codec\": %s, \"settings\": %s, \"bytes\": %.10g, \"bpvp\": %.6f, \"psnr_db\": %s, "
        "\"depth_rms_mm\": %.6f, \"depth_max_mm\": %.6f, \"encode_ms\": %.6f, \"decode_ms\": %.6f}",
        i ? "," : "", quoted (r.codec).c_str (), quoted (r.settings).c_str (), r.bytes, r.bpvp,
        psnr.c_str (), r.depth_rms_mm, r.depth_max_mm, r.encode_ms, r.decode_ms);
  }
  std::fputs ("\n]\n", file);
  const bool written = !std::ferror (file);
  return std::fclose (file) == 0 && written ? Status{} : not_writable (path);
}

} // namespace bench
