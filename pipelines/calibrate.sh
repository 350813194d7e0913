#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Calibrates cameras from pictures of a chessboard or ChArUco board, from files or live: a rig file.
set -euo pipefail
source "$(dirname "$0")/env.sh"

usage () {
  cat <<'END'
usage: calibrate.sh --left WHAT [--right WHAT] [--third WHAT] [--left WHAT ...] --out RIG [options]
  --left WHAT     the camera of a view, or the left camera of its stereo pair; each --left begins a view: 0, 1, ...
  --right WHAT    the right camera of that stereo pair
  --third WHAT    the third camera of that view
  --side-by-side WHAT, --top-bottom WHAT  a stereo camera that packs both pictures of a view into one, instead of --left and --right
  --out FILE      rig file to write: .yaml or .json
WHAT is one of
  'left%02d.jpg'  numbered pictures (.jpg, .png, .bmp); only numbers that all cameras have are used
  'left*.png'     pictures in order; all cameras must have the same number of them
  left.mp4        a video
  'v4l2src device=/dev/video0 ! image/jpeg ! jpegdec'   a live camera, in gst-launch-1.0 syntax
the board
  --board KIND    chessboard (default) or charuco
  --columns N     inner corners in a row, one less than squares (default 9)
  --rows N        inner corners in a column (default 6)
  --square M      side length of a square, metres (default 0.025)
  --marker M      charuco: side length of a marker, metres (default: 3/4 of a square)
  --dictionary D  charuco: marker dictionary (default 4x4-50)
the result
  --distortion D  coefficients: none, four, five (default) or eight
  --world W       centre (default), first-view or board: see docs/elements/rigcalibrate.md
  --near M --far M  depths of interest, metres (default 0.3 and 3)
  --min-frames N  minimum number of frames in which each camera sees the board (default 8)
  --stills DIR    write a PNG of each frame that was searched: all cameras side by side with the corners found, with a
                  green border if it is used
  --window        show these frames in a window
  --auto-finish   finish when the board has been seen in all parts of the pictures (live; Ctrl-C also finishes and calibrates)
END
}

# demo.sh builds without it.
need_element () {
  gst-inspect-1.0 --exists --atleast-version=0.0.0 rigcalibrate 2>/dev/null ||
    die "no element rigcalibrate: run $root/setup.sh"
}

# Limits come from gst-inspect-1.0, which runs once, so that they are written down in one place.
inspected=
property_of () { # property
  [ -n "$inspected" ] || { need_element && inspected=$(LC_ALL=C gst-inspect-1.0 --no-colors rigcalibrate); }
  awk -v name="$1" '/^  [a-z-]+ +:/ { inside = $1 == name } inside' <<<"$inspected"
}

# usage: set_property OPTION PROPERTY VALUE: checks it and adds it to the properties.
set_property () {
  local about kind range allowed value=$3
  about=$(property_of "$2")
  if grep -q ' Enum "' <<<"$about"; then
    allowed=$(sed -nE 's/^ *\([0-9]+\): ([^ ]+) .*/\1/p' <<<"$about" | paste -sd, | sed 's/,/, /g')
    [[ ", $allowed, " == *", $3, "* ]] || die "$1: expected one of $allowed, got '$3'"
  else
    read -r kind range < <(sed -nE 's/^ *(Integer|Double)\. Range: +([^ ]+) +- +([^ ]+) Default.*/\1 \2 to \3/p' <<<"$about")
    if [ "$kind" = Integer ]; then
      [[ "$3" =~ ^[0-9]{1,9}$ ]] && is_within "$3" "$range" || die "$1: expected a whole number from $range, got '$3'"
      value=$((10#$3))
    else
      [[ "$3" =~ ^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$ ]] && is_within "$3" "$range" ||
        die "$1: expected $range metres, got '$3'"
    fi
  fi
  properties+=("$2=$value")
}
is_within () { # value, "MIN to MAX"
  awk -v value="$1" -v min="${2% to *}" -v max="${2#* to }" 'BEGIN { exit !(value + 0 >= min + 0 && value + 0 <= max + 0) }'
}

roles=() views=() whats=() out= properties=() stills= window=
view=-1
while [ $# -gt 0 ]; do
  case "$1" in
    --left | --right | --third | --side-by-side | --top-bottom | --out | --board | --columns | --rows | --dictionary | --distortion | --world | --near | --far | \
      --min-frames | --square | --marker | --stills)
      [ $# -ge 2 ] && [[ -n "$2" && "$2" != --* ]] || die "option $1 needs a value" ;;
  esac
  case "$1" in
    --left | --right | --third | --side-by-side | --top-bottom)
      [ "$1" = --right ] || [ "$1" = --third ] || view=$((view + 1))
      [ $view -ge 0 ] || die "$1: expected after the --left of its view"
      roles+=("${1#--}") views+=("$view") whats+=("$2"); shift ;;
    --out) out=$2; shift ;;
    --board | --columns | --rows | --dictionary | --distortion | --world | --near | --far | --min-frames)
      set_property "$1" "${1#--}" "$2"; shift ;;
    --square | --marker) set_property "$1" "${1#--}-size" "$2"; shift ;;
    --stills) stills=$2; shift ;;
    --window) window=1 ;;
    --auto-finish) properties+=(auto-finish=true) ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift
done
[ ${#whats[@]} -gt 0 ] && [ -n "$out" ] || { usage >&2; die "expected at least --left or a packed camera, and --out"; }

need_element
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Prints "KEY FILE" for every picture of a pattern: its number, or its place in the order.
list_pictures () {
  local pattern=$1 file number before after count=0
  if [[ "$pattern" =~ ^([^%]*)%0?[0-9]*d([^%]*)$ ]]; then
    before=${BASH_REMATCH[1]} after=${BASH_REMATCH[2]}
    for file in "$before"*"$after"; do
      number=${file#"$before"}
      number=${number%"$after"}
      [[ "$number" =~ ^[0-9]+$ ]] || continue
      # shellcheck disable=SC2059 # the pattern is a format
      [ "$(printf "$pattern" "$((10#$number))")" != "$file" ] || echo "$((10#$number)) $file"
    done | sort -n
  else
    { compgen -G "$pattern" || true; } | sort -V | while read -r file; do
      echo "$count $file"
      count=$((count + 1))
    done
  fi
}

# An existing file is a video, whatever its name looks like.
is_source () { # a launch string: has a link, or begins with an element's name
  [ ! -e "$1" ] && { [[ "$1" == *!* ]] || gst-inspect-1.0 --exists --atleast-version=0.0.0 "${1%% *}" 2>/dev/null; }
}
is_pattern () { [ ! -e "$1" ] && ! is_source "$1" && [[ "$1" == *[%*?[]* ]]; }

# Pictures that all cameras have, numbered again: multifilesrc stops at a gap.
common=
for what in "${whats[@]}"; do
  is_pattern "$what" || continue
  list_pictures "$what" >"$folder/list"
  [ -s "$folder/list" ] || die "no pictures '$what'"
  cut -d ' ' -f 1 "$folder/list" | sort >"$folder/keys"
  if [ -z "$common" ]; then
    common=$folder/common
    cp "$folder/keys" "$common"
  else
    if [[ "$what" != *%* ]] && ! cmp -s "$common" "$folder/keys"; then
      die "'$what': $(wc -l <"$folder/keys") pictures; expected $(wc -l <"$common"), as for the other cameras"
    fi
    comm -12 "$common" "$folder/keys" >"$folder/both"
    mv "$folder/both" "$common"
  fi
done
if [ -n "$common" ]; then
  [ -s "$common" ] || die "the cameras have no picture number in common"
  sort -n -o "$common" "$common"
fi

# Sets `source` to the elements that play a camera.
describe_source () { # camera's number, WHAT
  local name=$1 what=$2 type key file count=0 words
  if is_source "$what"; then
    split_elements "$what" v4l2src "$what"
    source=("${words[@]}" ! videoconvert ! queue leaky=downstream max-size-buffers=2)
  elif is_pattern "$what"; then
    case "${what##*.}" in
      jpg | jpeg | JPG | JPEG) type=image/jpeg ;;
      png | PNG) type=image/png ;;
      bmp | BMP) type=image/bmp ;;
      *) die "'$what': expected .jpg, .png or .bmp pictures" ;;
    esac
    while read -r key file; do
      grep -qx "$key" "$common" || continue
      ln -s "$(realpath "$file")" "$folder/$name-$(printf %05d $count)"
      count=$((count + 1))
    done < <(list_pictures "$what")
    source=(multifilesrc "location=$folder/$name-%05d" "caps=$type,framerate=1/1" ! decodebin ! videoconvert ! queue)
  else
    [ -f "$what" ] || die "no file, pictures or source '$what'"
    ln -s "$(realpath "$what")" "$folder/$name-film" # gst-launch-1.0 knows special characters
    source=(filesrc "location=$folder/$name-film" ! decodebin ! videoconvert ! queue)
  fi
}

# Prints width and height of the first picture of `source`, from the header of a PNG: what gst-launch-1.0 -v prints may be cut off.
size_of_source () {
  local width height
  rm -f "$folder/first.png"
  LC_ALL=C timeout 30 gst-launch-1.0 "${source[@]}" ! videoconvert ! pngenc snapshot=true compression-level=1 ! filesink \
    "location=$folder/first.png" >/dev/null 2>"$folder/size.log" || true
  read -r width height < <(od -An -tu4 --endian=big -j16 -N8 "$folder/first.png" 2>/dev/null) && echo "$width $height"
}

# Of a launch string the source.
shorten () { if is_source "$1" && [[ "$1" == *" ! "* ]]; then echo "${1%% ! *} ! ..."; else echo "$1"; fi; }

# usage: check_halves OPTION WIDTH HEIGHT: a line if the camera hardly has two lenses
check_halves () {
  local width=$2 height=$3
  if [ "$1" = side-by-side ]; then width=$((width / 2)); else height=$((height / 2)); fi
  [ $((width * 10)) -lt $((height * 12)) ] || [ $((width * 10)) -gt $((height * 21)) ] || return 0
  echo "calibrate.sh: --$1: pictures of $2x$3 have halves of $width x $height, an unusual shape: is this a camera with two lenses," \
    "at a size in which it sends both pictures?" >&2
}

pads=() sources=()
add_camera () { # view, role, then the elements of its source
  local number=$((${#pads[@]} / 2)) view=$1 role=$2
  shift 2
  pads+=("sink_$number::view=$view" "sink_$number::role=$role")
  sources+=("$@" ! "c.sink_$number")
}
for i in "${!whats[@]}"; do
  describe_source "$i" "${whats[i]}"
  case "${roles[i]}" in
    left | right | third) add_camera "${views[i]}" "${roles[i]}" "${source[@]}" ;;
    *)
      read -r width height < <(size_of_source) ||
        die "--${roles[i]}: no picture comes from '$(shorten "${whats[i]}")'$(sed -nE 's/^(ERROR: from element [^ ]+|WARNING: erroneous pipeline): /: /p' "$folder/size.log" | head -n 1)"
      check_halves "${roles[i]}" "$width" "$height"
      if [ "${roles[i]}" = side-by-side ]; then
        left=(videocrop "right=$((width / 2))") right=(videocrop "left=$((width / 2))")
      else
        left=(videocrop "bottom=$((height / 2))") right=(videocrop "top=$((height / 2))")
      fi
      sources+=("${source[@]}" ! tee "name=packed_$i")
      add_camera "${views[i]}" left "packed_$i." ! queue ! "${left[@]}"
      add_camera "${views[i]}" right "packed_$i." ! queue ! "${right[@]}" ;;
  esac
done
sink=(fakesink sync=false)
[ -z "$window" ] || sink=(videoconvert ! autovideosink sync=false)
if [ -n "$stills" ]; then
  mkdir -p "$stills"
  sink=(tee name=t ! queue ! "${sink[@]}" t. ! queue ! videoconvert ! pngenc ! multifilesink "location=${stills//%/%%}/still-%05d.png")
fi

# The element's messages are lines of gst-launch-1.0 -m; the report makes them readable. It takes this process over, with its
# signals, and removes the folder.
exec python3 "$(dirname "$0")/calibration-report.py" "$folder" gst-launch-1.0 -e -m rigcalibrate name=c "location=$out" \
  "${properties[@]}" "${pads[@]}" ! "${sink[@]}" "${sources[@]}"
