#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Draws what codec_bench --json wrote: colour PSNR over bits per valid pixel, one line a codec.

    codec_bench ... --json codecs.json
    plot-codecs.py codecs.json --out codecs.svg [--title TEXT]

A line joins the settings of a codec that no other setting of it beats in both size and PSNR, among
those whose depth error is small enough. Codes without any loss of colour are marks in a row of their
own above. Needs nothing but Python."""
import argparse
import math
import sys
from xml.sax.saxutils import escape

from codec_rows import front, read_rows

WIDTH, HEIGHT = 980, 560
LEFT, RIGHT, TOP, BOTTOM = 70, 280, 60, 60  # margins, pixels
BAND = 34  # height of the row of lossless codes

# Okabe and Ito's colours, which people tell apart who see few; the peers are the greyer ones.
COLOURS = {"plain": "#0072b2", "packed": "#009e73", "entropy": "#d55e00", "temporal": "#cc79a7",
           "RVL + JPEG": "#444444", "RVL + zstd + JPEG": "#999999", "PNG16 + JPEG": "#e69f00",
           "RVL + PNG": "#8c6d31", "Draco": "#56b4e9"}
OTHERS = ["#7b4173", "#637939", "#843c39", "#393b79"]


def by_codec(rows, max_depth_rms):
    """Codec -> (rows of its line, its smallest lossless row or None), in the order of the file."""
    codecs = {}
    for row in rows:
        if row["depth_rms_mm"] <= max_depth_rms:
            codecs.setdefault(row["codec"], []).append(row)
    found = {}
    for codec, all_of_it in codecs.items():
        exact = [r for r in all_of_it if r["psnr_db"] is None]
        line = front(all_of_it)
        found[codec] = (line, min(exact, key=lambda r: r["bpvp"]) if exact else None)
    return found


class Axes:
    """Bits a valid pixel (logarithmic) and dB to pixels."""

    def __init__(self, bits, psnr):
        self.bits, self.psnr = bits, psnr

    def x(self, bits):
        low, high = self.bits
        return LEFT + (WIDTH - LEFT - RIGHT) * math.log(bits / low) / math.log(high / low)

    def y(self, psnr):
        low, high = self.psnr
        return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP - BAND) * (psnr - low) / (high - low)

    def ticks(self):
        for exponent in range(-3, 4):
            for digit in (1, 1.5, 2, 3, 4, 5, 7):
                bits = digit * 10.0 ** exponent
                if self.bits[0] <= bits <= self.bits[1]:
                    yield bits


def fit_axes(codecs, psnr):
    bits = [r["bpvp"] for line, exact in codecs.values() for r in line + ([exact] if exact else [])
            if r["psnr_db"] is None or psnr[0] <= r["psnr_db"] <= psnr[1]]
    if not bits:
        sys.exit("plot-codecs.py: no row left, expected some within --psnr and --max-depth-rms")
    return Axes((min(bits) / 1.1, max(bits) * 1.1), psnr)


def text(x, y, words, **attributes):
    named = "".join(f' {k.replace("_", "-")}="{v}"' for k, v in attributes.items())
    return f'<text x="{x:.1f}" y="{y:.1f}"{named}>{escape(words)}</text>'


def draw_grid(axes, title):
    left, right, bottom = LEFT, WIDTH - RIGHT, HEIGHT - BOTTOM
    yield text(left, TOP - 30, title, font_size=17, font_weight="bold")
    for bits in axes.ticks():
        x = axes.x(bits)
        yield f'<path d="M{x:.1f} {TOP}V{bottom}" stroke="#e4e4e4"/>'
        yield text(x, bottom + 18, f"{bits:g}", text_anchor="middle")
    low, high = axes.psnr
    for psnr in range(math.ceil(low), math.floor(high) + 1, 2):
        y = axes.y(psnr)
        yield f'<path d="M{left} {y:.1f}H{right}" stroke="#e4e4e4"/>'
        yield text(left - 8, y + 4, f"{psnr}", text_anchor="end")
    yield text(left - 8, TOP + BAND / 2 + 4, "lossless", text_anchor="end")
    yield f'<rect x="{left}" y="{TOP}" width="{right - left}" height="{BAND}" fill="#f6f6f6"/>'
    yield f'<rect x="{left}" y="{TOP}" width="{right - left}" height="{bottom - TOP}" fill="none" stroke="#666"/>'
    yield text((left + right) / 2, HEIGHT - 18, "bits per valid pixel, depth and colour together", text_anchor="middle")
    middle = (axes.y(low) + axes.y(high)) / 2
    yield text(18, middle, "colour PSNR, dB", text_anchor="middle", transform=f"rotate(-90 18 {middle:.1f})")


def style_of(codec, index):
    """Colour and dashes: a variant has its codec's colour."""
    colour = COLOURS.get(codec.split(",")[0], OTHERS[index % len(OTHERS)])
    return colour, ' stroke-dasharray="5 4"' if "whole picture" in codec or "long slices" in codec else ""


def draw_codec(axes, codec, index, line, exact):
    colour, dashes = style_of(codec, index)
    shown = [r for r in line if axes.psnr[0] <= r["psnr_db"] <= axes.psnr[1]]
    points = " ".join(f'{axes.x(r["bpvp"]):.1f},{axes.y(r["psnr_db"]):.1f}' for r in shown)
    if points:
        yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{dashes}/>'
    fill = "#fff" if dashes else colour
    for r in shown + ([exact] if exact else []):
        x, y = axes.x(r["bpvp"]), TOP + BAND / 2 if r["psnr_db"] is None else axes.y(r["psnr_db"])
        yield (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{fill}" stroke="{colour}">'
               f'<title>{escape(codec)}: {escape(r["settings"])}</title></circle>')
    x, y = WIDTH - RIGHT + 16, TOP + 12 + 22 * index
    yield f'<path d="M{x} {y}h26" stroke="{colour}" stroke-width="2"{dashes}/>'
    yield f'<circle cx="{x + 13}" cy="{y}" r="3.5" fill="{fill}" stroke="{colour}"/>'
    yield text(x + 34, y + 4, codec)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("json")
    parser.add_argument("--out", required=True, help="SVG to write")
    parser.add_argument("--title", default="Colour quality and size")
    parser.add_argument("--max-depth-rms", type=float, default=1.0, help="mm (default 1)")
    parser.add_argument("--psnr", type=float, nargs=2, default=(30, 46), help="dB, from and to (default 30 46)")
    options = parser.parse_args()
    if not options.psnr[0] < options.psnr[1]:
        parser.error("--psnr: expected the lower limit first")
    codecs = by_codec(read_rows(options.json), options.max_depth_rms)
    axes = fit_axes(codecs, tuple(options.psnr))
    parts = list(draw_grid(axes, options.title))
    for index, (codec, (line, exact)) in enumerate(codecs.items()):
        parts += draw_codec(axes, codec, index, line, exact)
    parts.append(text(LEFT, TOP - 12, f"depth error at most {options.max_depth_rms:g} mm rms", fill="#555"))
    try:
        with open(options.out, "w", encoding="utf-8") as f:
            f.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
                    f'height="{HEIGHT}" font-family="sans-serif" font-size="13">\n'
                    f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n' + "\n".join(parts) + "\n</svg>\n")
    except OSError as error:
        sys.exit(f"plot-codecs.py: --out {options.out}: {error.strerror}, expected a file to write")


if __name__ == "__main__":
    main()
