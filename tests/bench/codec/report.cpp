/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "measure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

using namespace rangecast;

namespace bench {
namespace {

/* Bytes of the peer at a PSNR, between its qualities on straight lines of logarithms; nothing
 * beyond its lowest and highest. */
std::optional<double>
bytes_of_peer (const std::vector<Row> &rows, double psnr_db)
{
  std::vector<const Row *> peer;
  for (const Row &row : rows)
    if (row.codec == kPeerName && std::isfinite (row.psnr_db))
      peer.push_back (&row);
  std::ranges::sort (peer, {}, &Row::psnr_db);
  for (std::size_t i = 1; i < peer.size (); i++) {
    const Row &a = *peer[i - 1], &b = *peer[i];
    if (psnr_db >= a.psnr_db && psnr_db <= b.psnr_db)
      return a.bytes *
             std::pow (b.bytes / a.bytes, (psnr_db - a.psnr_db) / (b.psnr_db - a.psnr_db));
  }
  return {};
}

std::string
text (const char *format, double value)
{
  char buffer[32];
  std::snprintf (buffer, sizeof buffer, format, value);
  return buffer;
}

constexpr int kNameWidth = 66; /* columns */

void
print_row (const Row &row, const std::optional<double> &peer)
{
  std::printf ("  %-*s %9.0f %6.2f %7s %7s %9.2f %9.2f %8.3f %8.3f\n", kNameWidth - 2,
      row.settings.c_str (), row.bytes, row.bpvp,
      std::isfinite (row.psnr_db) ? text ("%.2f", row.psnr_db).c_str () : "-",
      peer ? text ("%.1f %%", 100 * row.bytes / *peer).c_str () : "-", row.depth_rms_mm,
      row.depth_max_mm, row.encode_ms, row.decode_ms);
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
  std::printf ("%-*s %9s %6s %7s %7s %9s %9s %8s %8s\n", kNameWidth, "", "bytes", "bpvp", "PSNR dB",
      "of peer", "rms mm", "max mm", "enc ms", "dec ms");
  for (std::size_t i = 0; i < rows.size (); i++) {
    if (!i || rows[i].codec != rows[i - 1].codec)
      std::printf ("%s\n", rows[i].codec.c_str ());
    print_row (rows[i], bytes_of_peer (rows, rows[i].psnr_db));
  }
}

Status
write_json (const std::string &path, const std::vector<Row> &rows)
{
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return {StatusCode::kNotFound, "--json " + path + ": cannot be written"};
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
  return std::fclose (file) == 0 && written
             ? Status{}
             : Status{StatusCode::kNotFound, "--json " + path + ": cannot be written"};
}

} // namespace bench
