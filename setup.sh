#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs what the project needs (packages of Debian 12 or 13), configures and builds build/.
# Quick when nothing changed. What the compiler prints goes to build/setup.log.
# usage: setup.sh [--demo | --web | --cameras | --tests]
#   --demo     what demo.sh, the viewer and README's launch lines need
#   --web      what demo.sh --web needs: that, rangewebsink and its page
#   --cameras  what camera hosts and calibration need: that of --demo, cameras, simulated cameras, calibration
#   --tests    everything, as without an option: also the RTSP server, language bindings, tests and benchmarks
set -euo pipefail
cd "$(dirname "$0")"

targets=(all)
[ $# -le 1 ] || { echo "setup.sh: one option at a time" >&2; exit 2; }
case "${1:-}" in
  --demo | --web)
    targets=(demo)
    [ "$1" = --demo ] || targets+=(web)
    # What was built before is kept up to date, because env.sh makes all plugins known.
    ! compgen -G "build/gst/camera/*.so" >/dev/null || targets+=(plugins programs) ;;
  --cameras) targets=(cameras) ;;
  --tests | "") ;;
  --help | -h)
    sed -n '/^set/q; /^# usage/,$ s/^# //p' setup.sh
    exit ;;
  *)
    echo "setup.sh: unknown option '$1': use --demo, --web, --cameras or --tests" >&2
    exit 2
    ;;
esac

packages=(
  # build
  gcc g++ dpkg-dev meson ninja-build pkg-config git ca-certificates python3
  libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev libopencv-dev libtinygltf-dev libyaml-dev
  # run: launch strings, RTP, image and video files, software OpenGL without a display
  gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-base-apps gstreamer1.0-plugins-good gstreamer1.0-plugins-bad
  gstreamer1.0-libav glib-networking python3-yaml gstreamer1.0-gl libgl1-mesa-dri libegl1 libegl-mesa0 libgles2 libgl1
)
[[ "${1:-}" = --demo || "${1:-}" = --cameras ]] || packages+=(
  # rangewebsink, and its page: rangecast.wasm; calls
  libsoup-3.0-dev libjson-glib-dev libgstreamer-plugins-bad1.0-dev gstreamer1.0-nice
  clang-19 lld-19 wasi-libc libc++-19-dev-wasm32 libc++abi-19-dev-wasm32 libclang-rt-19-dev-wasm32
)
[ "${targets[0]}" = demo ] || packages+=(
  # calibration with its example images, cameras
  libopencv-contrib-dev opencv-doc libceres-dev libaravis-dev libusb-1.0-0-dev aravis-tools aravis-tools-cli
)
[ "${targets[0]}" != all ] || packages+=(
  # RTSP server
  libgstrtspserver-1.0-dev
  # language bindings of libgstrange
  libgirepository1.0-dev python3-gst-1.0 python3-numpy
  # benchmarks
  libturbojpeg0-dev zlib1g-dev
  # tests of the page
  nodejs chromium
  # tests
  abigail-tools libgtest-dev python3-opencv iproute2 openssl curl valgrind xvfb xauth xdotool
)

installed= # "yes" once packages were

missing_packages () {
  local package
  for package in "${packages[@]}"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || echo "$package"
  done
}

install_packages () {
  command -v dpkg-query >/dev/null || {
    echo "setup.sh: not a Debian system; install yourself what these packages hold: ${packages[*]}" >&2
    return 0
  }
  local missing sudo= command
  missing=$(missing_packages)
  [ -n "$missing" ] || return 0
  [ "$(id -u)" = 0 ] || sudo=sudo
  command="apt-get install --no-install-recommends ${missing//$'\n'/ }"
  echo "setup.sh: installing $(wc -w <<<"$missing") packages, which may take 10 minutes"
  # shellcheck disable=SC2086
  { $sudo apt-get update -qq &&
    { LC_ALL=C $command --assume-no 2>/dev/null | grep -E '^(Need to get|After this)' || true; } &&
    $sudo env DEBIAN_FRONTEND=noninteractive $command -y -qq >/dev/null; } || {
    echo "setup.sh: could not install packages; an administrator can: $command" >&2
    exit 1
  }
  installed=yes
}

log=build/setup.log

# usage: logged command...: its output goes to the log; when it fails, the end of that is shown
logged () {
  "$@" >"$log" 2>&1 || { show_failure; return 1; }
}

show_failure () {
  # ninja lets other jobs finish after the first failure, whose message may be long.
  { grep -q '^FAILED: ' "$log" && sed -n '/^FAILED: /,$p' "$log" | head -n 80 || tail -n 60 "$log"; } >&2
  echo "setup.sh: failed; the whole log is $PWD/$log" >&2
}

# Reads ninja's output: prints one line when the first job ends, and in a terminal the progress.
show_progress () {
  local line begun=
  while IFS= read -r line; do
    [[ "$line" =~ ^\[([0-9]+)/([0-9]+)\]\  ]] || continue
    [ -n "$begun" ] || echo "setup.sh: building; the first time this takes 10 to 30 minutes on two cores; the log is $log"
    begun=yes
    [ ! -t 1 ] || printf '\r%s of %s ' "${BASH_REMATCH[1]}" "${BASH_REMATCH[2]}"
  done
  [ -z "$begun" ] || [ ! -t 1 ] || echo
}

build () {
  # What was left out of build/ for want of a package is not, from now on.
  if [ -n "$installed" ] && [ -f build/build.ninja ]; then
    logged meson configure build --clearcache
    logged meson setup build --reconfigure
  fi
  if ! [ -f build/build.ninja ]; then
    echo "setup.sh: configuring"
    # -g1: backtraces have names and lines; no local variables, in three quarters of the time to compile.
    # ccache does not cache files that use a precompiled header.
    logged meson setup build -Ddebug=false -Dc_args=-g1 -Dcpp_args=-g1 -Db_pch="$(command -v ccache >/dev/null && echo false || echo true)"
  fi
  NINJA_STATUS='[%f/%t] ' ninja -C build "${targets[@]}" 2>&1 | tee "$log" | show_progress || { show_failure; return 1; }
}

# One at a time: demo.sh and run.sh may be started together.
lock_build () {
  mkdir -p build
  [ -w build ] || { echo "setup.sh: $PWD/build is not yours: run it as $(stat -c %U build), or copy the tree" >&2; exit 1; }
  exec 9>build/setup.lock
  flock -n 9 || { echo "setup.sh: waiting for another setup.sh in this folder"; flock 9; }
}

trap 'exit 130' INT
lock_build
install_packages
build
