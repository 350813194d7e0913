#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# One camera host: a stereo pair to a coded range image of the person, over RTP to the parent.
set -euo pipefail
source "$(dirname "$0")/env.sh"
source "$(dirname "$0")/rtp.sh"
source "$(dirname "$0")/audio.sh"

usage () {
  cat <<'END'
usage: camera-host.sh --view N --to HOST:PORT --rig FILE [options]
  --view N        view-id of this host's stereo pair in the rig
  --to HOST:PORT  where the parent listens for this host
  --rig FILE      rig file with all views
  --input WHAT    avatar (default): the built-in figure; avatar=MODEL: a glTF or OBJ model;
                  DIR: recorded pairs DIR/viewN-left.* and DIR/viewN-right.* (video files, or image
                  sequences viewN-left-%05d.png from 0), which begin with the empty scene;
                  range: exact range images of the built-in figure, without cameras and stereo
                  matching, to test everything downstream of them;
                  side-by-side=SOURCE, top-bottom=SOURCE: a stereo camera that packs both pictures into one, in
                  gst-launch-1.0 syntax, e.g. "side-by-side=v4l2src ! image/jpeg,width=1280,height=480 ! jpegdec";
                  cameras: the cameras that the rig names; cameras=LEFT,RIGHT[,THIRD]: cameras by
                  name, serial number or address
  --views N       number of simulated views, for avatar and range: as many as the rig has (the default)
  --size WxH      picture size, for avatar and cameras (default 320x240)
  --fps N         frames per second, for avatar, cameras and image sequences (default 15)
  --loop N        draw the first N pictures of avatar and repeat them forwards and backwards, so that the
                  simulated cameras take hardly any CPU time, like real ones (default 0: draw all)
  --format WHAT   pixel format of the cameras: rgb (default), bayer or grey
  --trigger HOW   free-run, software (default), hardware or action, for cameras
  --clock-server HOST:PORT  trigger the cameras by the clock that parent-host.sh --clock-port publishes
                  there (default: by this machine's clock)
  --action-send yes|no  with --trigger action: whether this host sends the action commands, which reach the
                  cameras of all hosts; exactly one host must (default: the host of view 0)
  --reconnect     wait for missing or lost cameras instead of ending
  --threads N     maximum number of CPU cores to use (default: all); lower it where several hosts share a
                  machine
  --learn N       number of frames from which the background is learnt (default 20)
  --depth WHAT    properties of stereodepth, e.g. "refresh-interval=60"
  --encoder WHAT  properties of neighbourcodeenc, e.g. "profile=entropy temporal=true" (default:
                  the element's: profile=packed)
  --audio SOURCE  send speech, too: a source in gst-launch-1.0 syntax, e.g. pulsesrc or "alsasrc device=hw:1"
  --audio-to HOST:PORT  where the parent (--audio) or viewers listen for it; RTCP goes to PORT + 1
END
  rtp_usage_sender
}

view= to= rig= input=avatar views= size=320x240 fps=15 learn=20
format=rgb trigger=software clock_server= action_send= reconnect=false depth= encoder= loop=0 threads= audio_source= audio_to= audio=()
while [ $# -gt 0 ]; do
  option=$1
  rtp_option sender "$1" "${2:-}"
  if [ $taken -gt 0 ]; then
    shift $taken || die "option $1 needs a value"
    continue
  fi
  case "$1" in
    --depth) depth=${2:-}; shift ;;
    --encoder) encoder=${2:-}; shift ;;
    --audio) audio_source=${2:-}; shift ;;
    --audio-to) audio_to=${2:-}; shift ;;
    --view) view=${2:-}; shift ;;
    --to) to=${2:-}; shift ;;
    --rig) rig=${2:-}; shift ;;
    --input) input=${2:-}; shift ;;
    --views) views=${2:-}; shift ;;
    --size) size=${2:-}; shift ;;
    --fps) fps=${2:-}; shift ;;
    --learn) learn=${2:-}; shift ;;
    --threads) threads=${2:-}; shift ;;
    --loop) loop=${2:-}; shift ;;
    --format) format=${2:-}; shift ;;
    --trigger) trigger=${2:-}; shift ;;
    --clock-server) clock_server=${2:-}; shift ;;
    --action-send) action_send=${2:-}; shift ;;
    --reconnect) reconnect=true ;;
    -h | --help) usage; exit 0 ;;
    *) usage >&2; die "unknown option '$1'" ;;
  esac
  shift || die "option $option needs a value"
done
need_option "$view" --view
need_option "$to" --to
need_option "$rig" --rig
need_number "$view" --view 0 63
[ -z "$views" ] || need_number "$views" --views 1 64
need_number "$fps" --fps 1 1000
need_number "$learn" --learn 1 100000
need_number "$loop" --loop 0 100000
if [ -n "$threads" ]; then
  need_number "$threads" --threads 1 1024
  export OPENCV_FOR_THREADS_NUM=$threads # OpenCV's own pool works for our loops, too
fi
need_size "$size" --size
case "$trigger" in
  free-run | software | hardware | action) ;;
  *) die "--trigger: expected free-run, software, hardware or action, got '$trigger'" ;;
esac
[ -n "$action_send" ] || { [ "$view" = 0 ] && action_send=yes || action_send=no; }
case "$action_send" in
  yes) action_send=true ;;
  no) action_send=false ;;
  *) die "--action-send: expected yes or no, got '$action_send'" ;;
esac
if [ -n "$clock_server" ]; then
  split_address "$clock_server" --clock-server
  [[ "$input" == cameras* ]] || die "--clock-server: expected with --input cameras; other inputs use this machine's clock"
fi
[ "$loop" = 0 ] || [[ "$input" == avatar* ]] || die "--loop: expected with --input avatar"
[ -z "$depth" ] || [ "$input" != range ] || die "--depth: expected with cameras; --input range has no stereodepth"
rtp_check sender
# Spellings that GStreamer accepts for true.
[[ ! "${encoder,,}" =~ adaptive-bitrate\ *=\ *[\"\']?(true|t|yes|1)([^a-z0-9]|$) ]] || rtp_adaptive=yes
[ -z "$rtp_adaptive" ] || { [ -n "$rtp_feedback" ] && one_receiver "$to"; } ||
  echo "camera-host.sh: --encoder: adaptive-bitrate has no effect; set --feedback, and one receiver in --to" >&2
split_properties "$depth" near=0.4 --depth stereodepth
depth=("${words[@]}")
split_properties "$encoder" profile=entropy --encoder neighbourcodeenc
encoder=("${words[@]}")
send_rtp "$to"
[ -z "$audio_source$audio_to" ] || need_option "$audio_source" --audio
if [ -n "$audio_source" ]; then
  need_option "$audio_to" --audio-to
  send_audio "$audio_source" "$audio_to"
  need_other_places "$audio_to" "$to"
  audio_clock "${clock_server:-system}"
fi
[ -f "$rig" ] || die "--rig: no file '$rig'"
case "$input" in
  avatar | avatar=* | range) # views and rig must describe the same cameras
    need_picture "$size" --size 4096
    rig_views=$(count_views "$rig")
    [ "$rig_views" -gt 0 ] || rig_views=${views:-4} # not a rig: stereodepth says why
    views=${views:-$rig_views}
    [ "$views" = "$rig_views" ] || die "--views is $views, but the rig '$rig' has $rig_views views" ;;
esac

# Sets `side` to the elements that play one side of a recorded pair at its own speed.
read_side () { # left|right
  local file type
  file=$(find "$input" -maxdepth 1 -name "view$view-$1.*" | head -n 1)
  if [ -n "$file" ]; then
    side=(filesrc "location=$file" ! decodebin ! videoconvert ! clocksync)
    return
  fi
  file=$(find "$input" -maxdepth 1 -name "view$view-$1-00000.*" | head -n 1)
  [ -n "$file" ] || die "--input: no view$view-$1.* and no view$view-$1-00000.* in '$input'"
  type=${file##*.}
  [ "$type" != jpg ] || type=jpeg
  side=(multifilesrc "location=$input/view$view-$1-%05d.${file##*.}" "caps=image/$type,framerate=$fps/1"
    ! decodebin ! videoconvert ! clocksync)
}

# Sets `cameras` to stereocamsrc and the elements that link it to stereodepth.
read_cameras () {
  local name names side
  cameras=(stereocamsrc name=cameras "trigger=$trigger" "reconnect=$reconnect" "action-send=$action_send")
  [ -z "$clock_server" ] || cameras+=("clock-server=$clock_server")
  if [ "$input" = cameras ]; then
    cameras+=("rig=$rig" "view-id=$view")
  else
    IFS=, read -ra names <<<"${input#cameras=}"
    [[ ",${input#cameras=}," != *,,* ]] && [ ${#names[@]} -ge 2 ] && [ ${#names[@]} -le 3 ] ||
      die "--input: expected cameras=LEFT,RIGHT or cameras=LEFT,RIGHT,THIRD, got '$input'"
    for side in left right third; do
      [ ${#names[@]} = 0 ] || cameras+=("$side=${names[0]}")
      names=("${names[@]:1}")
    done
  fi
  local pixels="width=${size%x*},height=${size#*x},framerate=$fps/1"
  case "$format" in
    rgb) pixels=("video/x-raw,format=RGB,$pixels") ;;
    grey) pixels=("video/x-raw,format=GRAY8,$pixels") ;;
    bayer) pixels=("video/x-bayer,$pixels" ! bayer2rgb) ;;
    *) die "--format: expected rgb, bayer or grey, got '$format'" ;;
  esac
  for side in "$@"; do
    cameras+=("cameras.$side" ! "${pixels[@]}" ! queue max-size-buffers=2 ! "depth.$side")
  done
}

depth=(stereodepth name=depth "rig=$rig" "view-id=$view" "${depth[@]}" !)
case "$input" in
  range)
    depth=()
    cameras=(avatartestsrc name=cameras is-live=true "views=$views" "view-id=$view" "empty-frames=$((learn + 5))"
      ! "video/x-range,width=${size%x*},height=${size#*x},framerate=$fps/1" ! queue max-size-buffers=2 !) ;;
  cameras=*,*,*) read_cameras left right third ;;
  cameras | cameras=*) read_cameras left right ;;
  avatar | avatar=*)
    caps="video/x-raw,format=RGBx,width=${size%x*},height=${size#*x},framerate=$fps/1"
    cameras=(avatartestsrc name=cameras is-live=true "views=$views" "view-id=$view" "empty-frames=$((learn + 5))" "loop-frames=$loop")
    [ "$input" = avatar ] || cameras+=("location=${input#avatar=}")
    cameras+=(cameras.left ! "$caps" ! queue max-size-buffers=2 ! depth.left
      cameras.right ! "$caps" ! queue max-size-buffers=2 ! depth.right) ;;
  side-by-side=* | top-bottom=*)
    split_elements "${input#*=}" "v4l2src after ${input%%=*}=" --input
    depth=("${depth[@]:0:2}" "packing=${input%%=*}" "${depth[@]:2}")
    cameras=("${words[@]}" ! queue max-size-buffers=2 ! depth.left) ;;
  *)
    [ -d "$input" ] || die "--input: '$input' is not avatar, avatar=MODEL, range, cameras, cameras=LEFT,RIGHT, side-by-side=SOURCE, top-bottom=SOURCE or a folder of recorded pairs"
    read_side left
    cameras=("${side[@]}" ! queue ! depth.left)
    read_side right
    cameras+=("${side[@]}" ! queue ! depth.right) ;;
esac

launch "${cameras[@]}" \
  "${depth[@]}" \
  roiextract "background-frames=$learn" \
  ! queue max-size-buffers=2 leaky=downstream \
  ! neighbourcodeenc "${encoder[@]}" ! "${rtp[@]}" "${audio[@]}"
