/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats_panel.hpp"

#include <algorithm>
#include <cairo.h>

namespace rangecast {
namespace {

constexpr int kLineHeight = 18, kBorder = 6; /* pixels */
constexpr double kFontSize = 13;
constexpr Rgbx kDark{16, 18, 21, 255}, kLight{236, 240, 244, 255};

/* Cairo's pixels are blue, green, red, alpha in memory, ours red, green, blue: so the two change
 * places. */
void
set_colour (cairo_t *cairo, Rgbx colour)
{
  cairo_set_source_rgb (cairo, colour.b / 255., colour.g / 255., colour.r / 255.);
}

/* A context for `picture`, to be destroyed by the caller. */
cairo_t *
begin (const ImageView<Rgbx> &picture)
{
  cairo_surface_t *surface =
      cairo_image_surface_create_for_data (reinterpret_cast<unsigned char *> (picture.data),
          CAIRO_FORMAT_ARGB32, picture.width, picture.height, static_cast<int> (picture.stride));
  cairo_t *cairo = cairo_create (surface);
  cairo_surface_destroy (surface);
  cairo_select_font_face (cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size (cairo, kFontSize);
  cairo_font_options_t *options = cairo_font_options_create ();
  cairo_font_options_set_antialias (options, CAIRO_ANTIALIAS_GRAY);
  cairo_set_font_options (cairo, options);
  cairo_font_options_destroy (options);
  return cairo;
}

int
width_of (cairo_t *cairo, const std::string &line)
{
  cairo_text_extents_t extents;
  cairo_text_extents (cairo, line.c_str (), &extents);
  return static_cast<int> (extents.x_advance + 1);
}

} // namespace

void
StatsPanel::draw (std::span<const std::string> lines)
{
  lines = lines.first (std::min (lines.size (), std::size_t{kMaxLines}));
  const int height = static_cast<int> (lines.size ()) * kLineHeight + kBorder;
  memory_.resize (std::size_t (kMaxWidth) * (kMaxLines * kLineHeight + kBorder));
  picture_ = {memory_.data (), kMaxWidth, height, std::ptrdiff_t (kMaxWidth * sizeof (Rgbx))};
  cairo_t *cairo = begin (picture_);
  set_colour (cairo, kDark);
  cairo_paint (cairo);
  set_colour (cairo, kLight);
  int width = 0, y = 0;
  for (const std::string &line : lines) {
    cairo_move_to (cairo, kBorder, y += kLineHeight - 1);
    cairo_show_text (cairo, line.c_str ());
    width = std::max (width, width_of (cairo, line));
    y++;
  }
  cairo_destroy (cairo);
  picture_.width = std::min (width + 2 * kBorder, kMaxWidth);
}

} // namespace rangecast
