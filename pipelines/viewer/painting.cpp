/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "painting.hpp"

#include <cairo.h>

#include <algorithm>
#include <cmath>

namespace {

constexpr double kUsualFontSize = 1 / 30.0;            /* of the picture's height */
constexpr double kMinFontSize = 12, kMaxFontSize = 26; /* pixels */
constexpr double kRoom = 0.94;                         /* of the picture, for panels */

void
set_font (cairo_t *cairo, double size, bool bold)
{
  cairo_select_font_face (cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
      bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size (cairo, size);
}

double
font_size (PictureSize picture)
{
  return std::clamp (picture.height * kUsualFontSize, kMinFontSize, kMaxFontSize);
}

/* Draws with cairo into a new rectangle. */
template <typename Draw>
GstVideoOverlayRectangle *
paint (int x, int y, int width, int height, const Draw &draw)
{
  if (width < 1 || height < 1)
    return nullptr;
  GstBuffer *buffer =
      gst_buffer_new_allocate (nullptr, gsize (width) * gsize (height) * 4, nullptr);
  GstMapInfo map;
  if (!buffer || !gst_buffer_map (buffer, &map, GST_MAP_WRITE)) {
    gst_clear_buffer (&buffer);
    return nullptr;
  }
  std::fill_n (map.data, map.size, guint8 (0));
  cairo_surface_t *surface = cairo_image_surface_create_for_data (
      map.data, CAIRO_FORMAT_ARGB32, width, height, 4 * width); /* premultiplied */
  cairo_t *cairo = cairo_create (surface);
  draw (cairo);
  cairo_destroy (cairo);
  cairo_surface_finish (surface);
  cairo_surface_destroy (surface);
  gst_buffer_unmap (buffer, &map);
  gst_buffer_add_video_meta (buffer, GST_VIDEO_FRAME_FLAG_NONE,
      GST_VIDEO_OVERLAY_COMPOSITION_FORMAT_RGB, guint (width), guint (height));
  GstVideoOverlayRectangle *rectangle = gst_video_overlay_rectangle_new_raw (buffer, x, y,
      guint (width), guint (height), GST_VIDEO_OVERLAY_FORMAT_FLAG_PREMULTIPLIED_ALPHA);
  gst_buffer_unref (buffer);
  return rectangle;
}

void
round_rectangle (cairo_t *cairo, double x, double y, double width, double height, double radius)
{
  cairo_new_sub_path (cairo);
  cairo_arc (cairo, x + width - radius, y + radius, radius, -M_PI / 2, 0);
  cairo_arc (cairo, x + width - radius, y + height - radius, radius, 0, M_PI / 2);
  cairo_arc (cairo, x + radius, y + height - radius, radius, M_PI / 2, M_PI);
  cairo_arc (cairo, x + radius, y + radius, radius, M_PI, 3 * M_PI / 2);
  cairo_close_path (cairo);
}

/* Sizes of a text panel, pixels. */
struct TextLayout {
  double font, line, border, keys = 0, texts = 0; /* keys, texts: widths of the columns */
  double gap = 0;                                 /* between them */
  std::size_t rows;

  TextLayout (std::span<const TextRow> lines, double font_size)
      : font (font_size), line (1.45 * font_size), border (0.8 * font_size), rows (lines.size ())
  {
    cairo_surface_t *surface = cairo_image_surface_create (CAIRO_FORMAT_A8, 1, 1);
    cairo_t *cairo = cairo_create (surface);
    const auto width = [&] (const std::string &text, bool bold) {
      cairo_text_extents_t extents;
      set_font (cairo, font, bold);
      cairo_text_extents (cairo, text.c_str (), &extents);
      return extents.x_advance;
    };
    for (const TextRow &row : lines) {
      keys = std::max (keys, width (row.key, true));
      texts = std::max (texts, width (row.text, false));
    }
    gap = keys > 0 ? 1.2 * font : 0;
    cairo_destroy (cairo);
    cairo_surface_destroy (surface);
  }
  [[nodiscard]] double width () const { return keys + gap + texts + 2 * border; }
  [[nodiscard]] double height () const { return line * double (rows) + 2 * border - 0.3 * font; }
};

void
draw_text (cairo_t *cairo, std::span<const TextRow> rows, const TextLayout &layout)
{
  round_rectangle (cairo, 0, 0, layout.width (), layout.height (), 0.5 * layout.font);
  cairo_set_source_rgba (cairo, 0.05, 0.06, 0.07, 0.78);
  cairo_fill (cairo);
  double y = layout.border + layout.font * 0.95;
  for (const TextRow &row : rows) {
    cairo_set_source_rgb (cairo, 1, 1, 1);
    set_font (cairo, layout.font, true);
    cairo_move_to (cairo, layout.border, y);
    cairo_show_text (cairo, row.key.c_str ());
    cairo_set_source_rgb (cairo, 0.86, 0.88, 0.9);
    set_font (cairo, layout.font, false);
    cairo_move_to (cairo, layout.border + layout.keys + layout.gap, y);
    cairo_show_text (cairo, row.text.c_str ());
    y += layout.line;
  }
}

} // namespace

GstVideoOverlayRectangle *
paint_text (std::span<const TextRow> rows, TextPlace place, double alpha, PictureSize picture)
{
  TextLayout layout (rows, font_size (picture));
  const double scale = std::min (
      {1.0, kRoom * picture.width / layout.width (), kRoom * picture.height / layout.height ()});
  if (scale < 1)
    layout = TextLayout (rows, layout.font * scale);
  const int width = std::min (int (std::ceil (layout.width ())), picture.width);
  const int height = std::min (int (std::ceil (layout.height ())), picture.height);
  const int lowest = std::max (0, TimeBarPlace (picture).top - height - 8);
  const int y = place == TextPlace::kTop      ? std::min (12, picture.height - height)
                : place == TextPlace::kBottom ? lowest
                                              : (picture.height - height) / 2;
  return paint ((picture.width - width) / 2, y, width, height, [&] (cairo_t *cairo) {
    cairo_push_group (cairo);
    draw_text (cairo, rows, layout);
    cairo_pop_group_to_source (cairo);
    cairo_paint_with_alpha (cairo, alpha);
  });
}

TimeBarPlace::TimeBarPlace (PictureSize picture)
    : height (int (2.2 * ::font_size (picture))), font_size (0.9 * ::font_size (picture))
{
  top = picture.height - height;
  begin = font_size;
  const double text = 6.5 * font_size; /* for "59:59 / 59:59" */
  end = std::max (begin + 1, picture.width - text - 2 * font_size);
  text_begin = end + font_size;
}

GstVideoOverlayRectangle *
paint_time_bar (double share, const std::string &times, PictureSize picture)
{
  const TimeBarPlace place (picture);
  if (place.top < 0)
    return nullptr;
  return paint (0, place.top, picture.width, place.height, [&] (cairo_t *cairo) {
    const double middle = place.height / 2.0, thick = 0.3 * place.font_size;
    const double at = place.begin + share * (place.end - place.begin);
    cairo_pattern_t *ground = cairo_pattern_create_linear (0, 0, 0, place.height);
    cairo_pattern_add_color_stop_rgba (ground, 0, 0, 0, 0, 0);
    cairo_pattern_add_color_stop_rgba (ground, 0.5, 0, 0, 0, 0.6);
    cairo_pattern_add_color_stop_rgba (ground, 1, 0, 0, 0, 0.75);
    cairo_set_source (cairo, ground);
    cairo_paint (cairo);
    cairo_pattern_destroy (ground);
    round_rectangle (
        cairo, place.begin, middle - thick / 2, place.end - place.begin, thick, thick / 2);
    cairo_set_source_rgba (cairo, 1, 1, 1, 0.35);
    cairo_fill (cairo);
    cairo_set_source_rgb (cairo, 0.93, 0.94, 0.95);
    cairo_rectangle (cairo, place.begin, middle - thick / 2, at - place.begin, thick);
    cairo_fill (cairo);
    cairo_arc (cairo, at, middle, 0.45 * place.font_size, 0, 2 * M_PI);
    cairo_fill (cairo);
    set_font (cairo, place.font_size, false);
    cairo_move_to (cairo, place.text_begin, middle + 0.36 * place.font_size);
    cairo_show_text (cairo, times.c_str ());
  });
}
