/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a user without a code of range images would send: two video streams of each view, colour in
 * 4:2:0 and depth as hues in 4:4:4, both by x264 through libavcodec. */
#include "codec.hpp"

#if HAVE_X264
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#endif

using namespace rangecast;

namespace bench {

#if HAVE_X264
namespace {

/* Frames from one key frame to the next. */
constexpr int kKeyInterval = 30;

struct FreeContext {
  void operator() (AVCodecContext *context) const { avcodec_free_context (&context); }
};
struct FreeFrame {
  void operator() (AVFrame *frame) const { av_frame_free (&frame); }
};
struct FreePacket {
  void operator() (AVPacket *packet) const { av_packet_free (&packet); }
};
using Context = std::unique_ptr<AVCodecContext, FreeContext>;

/* Rows of a plane of a frame. */
std::uint8_t *
row_of (const AVFrame &frame, int plane, int y)
{
  return frame.data[plane] + std::ptrdiff_t{y} * frame.linesize[plane];
}

/* Y, Cb, Cr of BT.601 in full range, in 1/65536 before rounding. */
struct Ycc {
  int y, cb, cr;
};

Ycc
ycc_of (Rgbx c)
{
  return {19595 * c.r + 38470 * c.g + 7471 * c.b, -11059 * c.r - 21709 * c.g + 32768 * c.b,
      32768 * c.r - 27439 * c.g - 5329 * c.b};
}

std::uint8_t
to_byte (int fixed)
{
  return std::uint8_t (std::clamp ((fixed + 32768) >> 16, 0, 255));
}

Rgbx
rgb_of (int y, int cb, int cr)
{
  const int luma = y << 16;
  cb -= 128;
  cr -= 128;
  return {to_byte (luma + 91881 * cr), to_byte (luma - 22554 * cb - 46802 * cr),
      to_byte (luma + 116130 * cb), 0};
}

/* One stream of one view. */
class Stream {
public:
  /* @param crf  constant rate factor of x264: 0 is best, 51 worst */
  bool open (int width, int height, AVPixelFormat format, int crf)
  {
    const AVCodec *encoder = avcodec_find_encoder_by_name ("libx264");
    const AVCodec *decoder = avcodec_find_decoder (AV_CODEC_ID_H264);
    if (!encoder || !decoder)
      return false;
    encoder_.reset (avcodec_alloc_context3 (encoder));
    decoder_.reset (avcodec_alloc_context3 (decoder));
    frame_.reset (av_frame_alloc ());
    decoded_.reset (av_frame_alloc ());
    packet_.reset (av_packet_alloc ());
    if (!encoder_ || !decoder_ || !frame_ || !decoded_ || !packet_)
      return false;
    encoder_->width = frame_->width = width;
    encoder_->height = frame_->height = height;
    encoder_->pix_fmt = format;
    frame_->format = format;
    encoder_->color_range = frame_->color_range = AVCOL_RANGE_JPEG;
    encoder_->time_base = {1, 30};
    encoder_->gop_size = kKeyInterval;
    encoder_->thread_count = 1;
    decoder_->thread_count = 1;
    decoder_->flags |= AV_CODEC_FLAG_LOW_DELAY;
    const std::pair<const char *, std::string> options[] = {{"preset", "veryfast"},
        {"tune", "zerolatency"}, {"crf", std::to_string (crf)}, {"forced-idr", "1"}};
    for (const auto &[name, value] : options)
      if (av_opt_set (encoder_->priv_data, name, value.c_str (), 0))
        return false;
    return !avcodec_open2 (encoder_.get (), encoder, nullptr) &&
           !avcodec_open2 (decoder_.get (), decoder, nullptr) &&
           !av_frame_get_buffer (frame_.get (), 0);
  }

  void request_key () { key_ = true; }
  /* The frame to fill before encode(). */
  AVFrame *frame () { return av_frame_make_writable (frame_.get ()) ? nullptr : frame_.get (); }

  Status encode ()
  {
    frame_->pts = number_++;
    frame_->pict_type = key_ ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
    key_ = false;
    if (avcodec_send_frame (encoder_.get (), frame_.get ()) ||
        avcodec_receive_packet (encoder_.get (), packet_.get ()))
      return fail ("no coded frame");
    coded_.assign (packet_->data, packet_->data + packet_->size);
    av_packet_unref (packet_.get ());
    return {};
  }
  [[nodiscard]] const std::vector<std::uint8_t> &coded () const { return coded_; }

  /* The decoded frame is at `to` until the next call. */
  Status decode (const std::vector<std::uint8_t> &from, const AVFrame *&to)
  {
    if (av_new_packet (packet_.get (), int (from.size ())))
      return fail ("no memory");
    std::memcpy (packet_->data, from.data (), from.size ());
    const bool bad = avcodec_send_packet (decoder_.get (), packet_.get ()) != 0;
    av_packet_unref (packet_.get ());
    if (bad || avcodec_receive_frame (decoder_.get (), decoded_.get ()))
      return fail ("no decoded frame");
    to = decoded_.get ();
    return {};
  }

private:
  static Status fail (const std::string &what) { return {StatusCode::kInternal, "x264: " + what}; }

  Context encoder_, decoder_;
  std::unique_ptr<AVFrame, FreeFrame> frame_, decoded_;
  std::unique_ptr<AVPacket, FreePacket> packet_;
  std::vector<std::uint8_t> coded_;
  std::int64_t number_ = 0;
  bool key_ = false;
};

void
write_420 (const Picture &from, AVFrame &to)
{
  for (int y = 0; y < from.height; y += 2)
    for (int x = 0; x < from.width; x += 2) {
      int cb = 0, cr = 0, count = 0;
      for (int v = y; v < std::min (y + 2, from.height); v++)
        for (int u = x; u < std::min (x + 2, from.width); u++, count++) {
          const Ycc c = ycc_of (from.colour[std::size_t (v * from.width + u)]);
          row_of (to, 0, v)[u] = to_byte (c.y);
          cb += c.cb;
          cr += c.cr;
        }
      row_of (to, 1, y / 2)[x / 2] = to_byte (cb / count + (128 << 16));
      row_of (to, 2, y / 2)[x / 2] = to_byte (cr / count + (128 << 16));
    }
}

/* A sample of a plane of half the size at the place of a pixel, linearly interpolated: the nearest
 * one counts nine sixteenths. */
int
chroma_at (const AVFrame &from, int plane, int x, int y, int width, int height)
{
  const int x0 = x / 2, y0 = y / 2;
  const int x1 = std::clamp (x0 + (x % 2 ? 1 : -1), 0, (width - 1) / 2);
  const int y1 = std::clamp (y0 + (y % 2 ? 1 : -1), 0, (height - 1) / 2);
  const std::uint8_t *near = row_of (from, plane, y0), *far = row_of (from, plane, y1);
  return (9 * near[x0] + 3 * near[x1] + 3 * far[x0] + far[x1] + 8) >> 4;
}

void
read_420 (const AVFrame &from, Picture &to)
{
  for (int y = 0; y < to.height; y++)
    for (int x = 0; x < to.width; x++)
      to.colour[std::size_t (y * to.width + x)] =
          rgb_of (row_of (from, 0, y)[x], chroma_at (from, 1, x, y, to.width, to.height),
              chroma_at (from, 2, x, y, to.width, to.height));
}

/* Depth as a fully saturated hue, as Intel describes it ("Depth image compression by colorization
 * for RealSense depth cameras", 2020): red, yellow, green, cyan, blue, magenta, red, in 1530 steps,
 * linear between near and far. */
class Hues {
public:
  explicit Hues (const View &view)
      : near_ (view.near_m / view.depth_unit_m),
        range_ ((view.far_m - view.near_m) / view.depth_unit_m)
  {
  }

  void write (const Picture &from, AVFrame &to) const
  {
    for (int y = 0; y < from.height; y++)
      for (int x = 0; x < from.width; x++) {
        const Ycc c = ycc_of (colour (from.depth[std::size_t (y * from.width + x)]));
        row_of (to, 0, y)[x] = to_byte (c.y);
        row_of (to, 1, y)[x] = to_byte (c.cb + (128 << 16));
        row_of (to, 2, y)[x] = to_byte (c.cr + (128 << 16));
      }
  }

  void read (const AVFrame &from, Picture &to) const
  {
    for (int y = 0; y < to.height; y++)
      for (int x = 0; x < to.width; x++)
        to.depth[std::size_t (y * to.width + x)] =
            depth (rgb_of (row_of (from, 0, y)[x], row_of (from, 1, y)[x], row_of (from, 2, y)[x]));
  }

private:
  [[nodiscard]] Rgbx colour (std::uint16_t depth) const
  {
    if (!depth)
      return {};
    const int hue = std::clamp (int (std::lround ((depth - near_) / range_ * kLast)), 0, kLast);
    const auto rise = std::uint8_t (hue % 255), fall = std::uint8_t (255 - hue % 255);
    switch (hue / 255) {
      case 0:
        return {255, rise, 0, 0};
      case 1:
        return {fall, 255, 0, 0};
      case 2:
        return {0, 255, rise, 0};
      case 3:
        return {0, fall, 255, 0};
      case 4:
        return {rise, 0, 255, 0};
      default:
        return {255, 0, fall, 0};
    }
  }

  [[nodiscard]] std::uint16_t depth (Rgbx c) const
  {
    const int max = std::max ({c.r, c.g, c.b}), min = std::min ({c.r, c.g, c.b});
    if (max == min)
      return std::uint16_t (std::lround (near_));
    const double part = 255.0 / (max - min);
    double hue = 0;
    if (max == c.r)
      hue = (c.g - c.b) * part + (c.g >= c.b ? 0 : 6 * 255);
    else if (max == c.g)
      hue = (c.b - c.r) * part + 2 * 255;
    else
      hue = (c.r - c.g) * part + 4 * 255;
    return std::uint16_t (std::lround (
        std::clamp (near_ + std::min (hue, double (kLast)) / kLast * range_, 1.0, 65535.0)));
  }

  static constexpr int kLast = 6 * 255 - 1;
  double near_, range_; /* depth units */
};

class X264 final : public Codec {
public:
  X264 (const Rig &rig, int colour_crf, int depth_crf)
      : Codec (name_of ("x264 + x264 hue depth", true),
            "x264 4:2:0 crf " + std::to_string (colour_crf) + ", hue depth 4:4:4 crf " +
                std::to_string (depth_crf),
            true),
        rig_ (rig)
  {
    for (const View &view : rig.views)
      views_.emplace_back (view);
  }

  /* @return false if this libavcodec has no x264, or x264 cannot code pictures of this size */
  bool open (int colour_crf, int depth_crf)
  {
    for (std::size_t i = 0; i < views_.size (); i++) {
      const View &v = rig_.views[i];
      if (!views_[i].colour.open (v.width, v.height, AV_PIX_FMT_YUV420P, colour_crf) ||
          !views_[i].depth.open (v.width, v.height, AV_PIX_FMT_YUV444P, depth_crf))
        return false;
    }
    return true;
  }

  void begin () override
  {
    for (Streams &view : views_) {
      view.colour.request_key ();
      view.depth.request_key ();
    }
  }

  Status encode (FrameSet &set) override
  {
    for (Streams &view : views_)
      view.sent = false;
    for (const ViewPictures &pictures : set) {
      Streams &view = views_[index_of (pictures.view_id)];
      AVFrame *const colour = view.colour.frame (), *const depth = view.depth.frame ();
      if (!colour || !depth)
        return {StatusCode::kInternal, "x264: no memory"};
      write_420 (pictures.whole, *colour);
      view.hues.write (pictures.whole, *depth);
      if (Status s = view.colour.encode (); !s.ok ())
        return s;
      if (Status s = view.depth.encode (); !s.ok ())
        return s;
      view.sent = true;
    }
    return {};
  }

  /* Two pieces of each view, empty where a frame set lacks it. */
  void collect (Coded &to) const override
  {
    to.assign (2 * views_.size (), {});
    for (std::size_t i = 0; i < views_.size (); i++)
      if (views_[i].sent) {
        to[2 * i] = views_[i].colour.coded ();
        to[2 * i + 1] = views_[i].depth.coded ();
      }
  }

  Status decode (const Coded &from, std::vector<Picture> &pictures) override
  {
    auto picture = pictures.begin ();
    for (std::size_t i = 0; i < views_.size (); i++) {
      if (from[2 * i].empty ())
        continue;
      const AVFrame *colour = nullptr, *depth = nullptr;
      if (Status s = views_[i].colour.decode (from[2 * i], colour); !s.ok ())
        return s;
      if (Status s = views_[i].depth.decode (from[2 * i + 1], depth); !s.ok ())
        return s;
      read_420 (*colour, *picture);
      views_[i].hues.read (*depth, *picture);
      ++picture;
    }
    return {};
  }

  /* This peer gets the mask for nothing: what is black in it is not exactly what was. */
  Status finish (const FrameSet &set, std::vector<Picture> &pictures) override
  {
    for (std::size_t v = 0; v < set.size (); v++)
      for (std::size_t i = 0; i < pictures[v].depth.size (); i++)
        if (!set[v].whole.depth[i])
          pictures[v].depth[i] = 0;
    return {};
  }

private:
  struct Streams {
    Stream colour, depth;
    Hues hues;
    bool sent = false;

    explicit Streams (const View &view) : hues (view) {}
  };

  [[nodiscard]] std::size_t index_of (int view_id) const
  {
    return static_cast<std::size_t> (rig_.find (view_id) - rig_.views.data ());
  }

  Rig rig_;
  std::vector<Streams> views_;
};

} // namespace

std::unique_ptr<Codec>
make_x264 (const Rig &rig, int colour_crf, int depth_crf)
{
  av_log_set_level (AV_LOG_ERROR);
  auto made = std::make_unique<X264> (rig, colour_crf, depth_crf);
  return made->open (colour_crf, depth_crf) ? std::move (made) : nullptr;
}

#else

std::unique_ptr<Codec>
make_x264 (const Rig &, int, int)
{
  return nullptr;
}

#endif

} // namespace bench
