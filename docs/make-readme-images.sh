#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes README's image and film: the whole system, live, with cameras of 640x480, at a rate that two slow cores can keep up with. usage: docs/make-readme-images.sh [FOLDER
# [MODEL.glb]], by default docs/images and the dressed head of the test data; without that, the built-in figure. Wants ffmpeg (Debian
# package ffmpeg).
set -euo pipefail
docs=$(cd "$(dirname "$0")" && pwd)
out=$(realpath "${1:-$docs/images}")
model=${2:-${RANGECAST_DATA:-$docs/../../shared/data}/dressed_head/dressed_head.glb}
input=avatar
if [ -f "$model" ]; then
  input=avatar=$(realpath "$model")
elif [ -n "${2:-}" ]; then
  echo "make-readme-images.sh: no model '$model'" >&2
  exit 1
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
command -v ffmpeg >/dev/null || { echo "make-readme-images.sh: no ffmpeg (Debian package ffmpeg)" >&2; exit 1; }

"$docs/../pipelines/demo.sh" --input "$input" --size 640x480 --fps 3 --loop 48 --latency 200 --frames 48 --out "$work"
cp "$work/avatar.png" "$out/avatar.png"
ffmpeg -v error -y -i "$work/avatar.webm" -vf 'setpts=N/(8*TB),scale=400:300' -r 8 -c:v libwebp_anim -quality 80 -loop 0 "$out/avatar.webp"
