#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs what the project needs (Debian 12 packages), configures and builds build/.
# Quick when nothing changed. Everything it prints beyond a line goes to build/setup.log.
# usage: setup.sh [--demo | --tests]
#   --demo   plugins and programs of the demo only, without calibration, cameras, RTSP server, language bindings, tests and benchmarks
#   --tests  everything, as without an option
set -euo pipefail
cd "$(dirname "$0")"

targets=(all)
case "${1:-}" in
  --demo) targets=(plugins programs) ;;
  --tests | "") ;;
  *)
    echo "setup.sh: unknown option '$1'; expected --demo or --tests" >&2
    exit 2
    ;;
esac

packages=(
  # build
  gcc g++ meson ninja-build pkg-config git ca-certificates python3
  libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev libgstreamer-plugins-bad1.0-dev libopencv-dev libassimp-dev libyaml-dev zlib1g-dev libcairo2-dev
  # run: launch strings, RTP, image and video files, software OpenGL without a display
  gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-base-apps gstreamer1.0-plugins-good gstreamer1.0-plugins-bad
  gstreamer1.0-libav glib-networking gstreamer1.0-gl libgl1-mesa-dri libegl1 libegl-mesa0 libgles2 libgl1
)
[ "${targets[0]}" != all ] || packages+=(
  # calibration, cameras, RTSP server
  libopencv-contrib-dev libceres-dev libaravis-dev libusb-1.0-0-dev libgstrtspserver-1.0-dev
  # language bindings of libgstrange
  libgirepository1.0-dev python3-gst-1.0 python3-numpy
  # benchmarks
  libturbojpeg0-dev libzstd-dev libpng-dev libdraco-dev libavcodec-dev
  # tests
  libgtest-dev iproute2 openssl opencv-doc valgrind xvfb xauth xdotool aravis-tools aravis-tools-cli umockdev libumockdev-dev
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
  local missing sudo=
  missing=$(missing_packages)
  [ -n "$missing" ] || return 0
  [ "$(id -u)" = 0 ] || sudo=sudo
  echo "setup.sh: installing $(wc -w <<<"$missing") packages"
  $sudo apt-get update -qq
  # shellcheck disable=SC2086
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
  installed=yes
}

build () {
  local log=build/setup.log
  mkdir -p build
  # What was left out of build/ for want of a package is not, from now on.
  if [ -n "$installed" ] && [ -f build/build.ninja ]; then
    { meson configure build --clearcache && meson setup build --reconfigure; } >"$log" 2>&1 || { cat "$log" >&2; return 1; }
  fi
  if ! [ -f build/build.ninja ]; then
    echo "setup.sh: configuring"
    # -g1: backtraces have names and lines; no local variables, in three quarters of the time to compile.
    # ccache does not cache files that use a precompiled header.
    meson setup build -Ddebug=false -Dc_args=-g1 -Dcpp_args=-g1 -Db_pch="$(command -v ccache >/dev/null && echo false || echo true)" >"$log" 2>&1 ||
      { cat "$log" >&2; return 1; }
  fi
  ninja -C build "${targets[@]}" >"$log" 2>&1 || { cat "$log" >&2; return 1; }
}

install_packages
build
