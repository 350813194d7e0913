#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The page in headless Chromium: beside striprender, before servers that a test plays, and with rangewebsink. Exit status 77 (skipped) where Chromium, or puppeteer-core and
# the network that it comes from, are missing. Pictures stay in build/web-test.
# usage: tests/web/page.sh [options of node --test]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export RANGECAST_SOURCE=${RANGECAST_SOURCE:-$(cd "$here/../.." && pwd)}
export RANGECAST_BUILD=${RANGECAST_BUILD:-$RANGECAST_SOURCE/build}
skip () { echo "skipped: $*"; exit 77; }

browser=$(command -v chromium || command -v chromium-browser || true)
[ -n "$browser" ] || skip "chromium is missing"
work=$RANGECAST_BUILD/web-test
mkdir -p "$work"
if ! [ -d "$work/node_modules/puppeteer-core" ] || ! [ -d "$work/node_modules/ws" ]; then
  command -v npm >/dev/null || skip "npm is missing, which installs puppeteer-core and ws"
  (cd "$work" && echo '{}' >package.json && timeout 120 npm install --silent --no-audit --no-fund puppeteer-core ws >/dev/null 2>&1) ||
    skip "npm cannot install puppeteer-core and ws"
fi

# The known scene, and what striprender makes of it from five angles.
export GST_PLUGIN_PATH=$RANGECAST_BUILD/gst GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device
source=$work/scene.rcnc
gst-launch-1.0 -q avatartestsrc views=4 num-buffers=1 range-person-only=true ! video/x-range,width=320,height=240,framerate=15/1 \
  ! neighbourcodeenc ! neighbourcodeparse ! application/x-neighbour-code,alignment=byte-stream ! filesink "location=$source"
gst-launch-1.0 -q avatartestsrc views=4 num-buffers=40 range-person-only=true ! video/x-range,width=160,height=120,framerate=15/1 \
  ! neighbourcodeenc ! neighbourcodeparse ! application/x-neighbour-code,alignment=byte-stream ! filesink "location=$work/moving.rcnc"
for mode in blend strips; do
  for angle in 0 -30 45 100 180; do
    gst-launch-1.0 -q filesrc "location=$source" ! neighbourcodeparse ! neighbourcodedec ! striprender "mode=$mode" fit=true "azimuth=$angle" \
      ! "video/x-raw(memory:GLMemory),format=RGBA,width=640,height=480" ! gldownload ! videoconvert ! pngenc snapshot=true \
      ! filesink "location=$work/native-$mode-$angle.png" || skip "striprender cannot draw here"
  done
done
export CHROMIUM=$browser
live=("$here/live.test.js")
compgen -G "$RANGECAST_BUILD/gst/web/*.so" >/dev/null || { echo "left out: live.test.js, because rangewebsink is missing"; live=(); }
exec node --test "$@" "$here/page.test.js" "$here/server.test.js" "${live[@]}"
