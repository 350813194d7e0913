/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "measure.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>

using namespace rangecast;

namespace bench {
namespace {

/* CPU time of the process, ms: other processes that take a core away do not count. */
double
now_ms ()
{
  timespec t{};
  clock_gettime (CLOCK_PROCESS_CPUTIME_ID, &t);
  return double (t.tv_sec) * 1e3 + double (t.tv_nsec) * 1e-6;
}

double
median (std::vector<double> values)
{
  const auto middle = values.begin () + std::ptrdiff_t (values.size () / 2);
  std::ranges::nth_element (values, middle);
  return *middle;
}

/* Sums over pixels with depth. */
struct Errors {
  double colour = 0, depth = 0, depth_max = 0; /* squares of grey levels; mm and their squares */
  double points = 0;

  /* @return whether both pictures have depth in the same pixels */
  bool add (const Picture &original, const Picture &decoded, double unit_m)
  {
    for (std::size_t i = 0; i < original.depth.size (); i++) {
      if ((original.depth[i] != 0) != (decoded.depth[i] != 0))
        return false;
      if (!original.depth[i])
        continue;
      const Rgbx p = original.colour[i], q = decoded.colour[i];
      const int r = p.r - q.r, g = p.g - q.g, b = p.b - q.b;
      colour += r * r + g * g + b * b;
      const double mm = std::abs (int (original.depth[i]) - int (decoded.depth[i])) * unit_m * 1e3;
      depth += mm * mm;
      depth_max = std::max (depth_max, mm);
      points++;
    }
    return true;
  }
};

/* One codec on its way through the rounds. */
class Runner {
public:
  Runner (Codec &codec, Input &input) : codec_ (codec), input_ (input), coded_ (input.sets.size ())
  {
  }

  /* Coded bytes and quality. */
  Status check (Row &row)
  {
    if (Status s = encode (false); !s.ok ())
      return s;
    Errors errors;
    for (std::size_t i = 0; i < coded_.size (); i++) {
      const FrameSet &set = input_.sets[i];
      make_room (set, true);
      if (Status s = codec_.decode (coded_[i], pictures_); !s.ok ())
        return s;
      for (std::size_t v = 0; v < set.size (); v++)
        if (!errors.add (
                set[v].person, pictures_[v], input_.rig.find (set[v].view_id)->depth_unit_m))
          return {StatusCode::kBadData, "other pixels have depth after decoding"};
    }
    report (errors, row);
    return {};
  }

  /* With a single frame set, once more before: a stream of them would find its tables in the cache.
   */
  Status round ()
  {
    const bool warm_up = coded_.size () == 1;
    if (Status s = encode (warm_up); !s.ok ())
      return s;
    return decode (warm_up);
  }

  void times (Row &row) const
  {
    row.encode_ms = median (encode_ms_);
    row.decode_ms = median (decode_ms_);
  }

private:
  Status encode (bool warm_up)
  {
    double total = 0;
    codec_.begin ();
    for (std::size_t i = 0; i < coded_.size (); i++) {
      FrameSet &set = input_.sets[i];
      if (warm_up)
        if (Status s = codec_.encode (set); !s.ok ())
          return s;
      const double begin = now_ms ();
      Status s = codec_.encode (set);
      total += now_ms () - begin;
      if (!s.ok ())
        return s;
      codec_.collect (coded_[i]);
    }
    encode_ms_.push_back (total / double (coded_.size ()));
    return {};
  }

  Status decode (bool warm_up)
  {
    double total = 0;
    for (std::size_t i = 0; i < coded_.size (); i++) {
      make_room (input_.sets[i], false);
      if (warm_up)
        if (Status s = codec_.decode (coded_[i], pictures_); !s.ok ())
          return s;
      const double begin = now_ms ();
      Status s = codec_.decode (coded_[i], pictures_);
      total += now_ms () - begin;
      if (!s.ok ())
        return s;
    }
    decode_ms_.push_back (total / double (coded_.size ()));
    return {};
  }

  /* @param spoil  so that a pixel that nobody writes is found */
  void make_room (const FrameSet &set, bool spoil)
  {
    pictures_.resize (set.size ());
    for (std::size_t v = 0; v < set.size (); v++) {
      const Picture &as = set[v].person;
      Picture &to = pictures_[v];
      to.width = as.width;
      to.height = as.height;
      to.depth.resize (as.depth.size ());
      to.colour.resize (as.colour.size ());
      if (spoil) {
        std::ranges::fill (to.depth, std::uint16_t{0xaaaa});
        std::ranges::fill (to.colour, Rgbx{0xaa, 0x55, 0xaa, 0x55});
      }
    }
  }

  void report (const Errors &errors, Row &row) const
  {
    std::size_t bytes = 0;
    for (const Coded &coded : coded_)
      for (const auto &piece : coded)
        bytes += piece.size ();
    row.codec = codec_.name ();
    row.settings = codec_.settings ();
    row.bytes = double (bytes) / double (coded_.size ());
    row.bpvp = 8 * double (bytes) / errors.points;
    row.psnr_db = errors.colour > 0
                      ? 10 * std::log10 (255.0 * 255 * 3 * errors.points / errors.colour)
                      : std::numeric_limits<double>::infinity ();
    row.depth_rms_mm = std::sqrt (errors.depth / errors.points);
    row.depth_max_mm = errors.depth_max;
  }

  Codec &codec_;
  Input &input_;
  std::vector<Coded> coded_; /* by frame set */
  std::vector<Picture> pictures_;
  std::vector<double> encode_ms_, decode_ms_; /* of a frame set, by round */
};

} // namespace

Status
measure (Input &input, const Codecs &codecs, int rounds, std::vector<Row> &rows)
{
  std::vector<Runner> runners;
  for (const auto &codec : codecs)
    runners.emplace_back (*codec, input);
  rows.assign (codecs.size (), {});
  for (int round = -1; round < rounds; round++)
    for (std::size_t i = 0; i < codecs.size (); i++)
      if (Status s = round < 0 ? runners[i].check (rows[i]) : runners[i].round (); !s.ok ())
        return {
            s.code (), codecs[i]->name () + " (" + codecs[i]->settings () + "): " + s.message ()};
  for (std::size_t i = 0; i < codecs.size (); i++)
    runners[i].times (rows[i]);
  return {};
}

} // namespace bench
