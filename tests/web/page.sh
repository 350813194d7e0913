#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The page in headless Chromium: beside striprender, before servers that a test plays, and with rangewebsink. Pictures stay in build/web-test.
# usage: tests/web/page.sh [options of node --test]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/need-browser.sh"
PATH=$RANGECAST_BUILD/pipelines:$PATH

# The known scene, and what striprender makes of it from two angles.
source=$work/scene.rcnc
gst-launch-1.0 -q avatartestsrc views=4 num-buffers=1 range-person-only=true ! video/x-range,width=320,height=240,framerate=15/1 \
  ! neighbourcodeenc ! filesink "location=$source"
for recording in moving:15 slow:1; do # of slow something is left to play, however busy the machine is
  gst-launch-1.0 -q avatartestsrc views=4 num-buffers=40 range-person-only=true \
    ! "video/x-range,width=160,height=120,framerate=${recording#*:}/1" ! neighbourcodeenc ! filesink "location=$work/${recording%:*}.rcnc"
done
gst-launch-1.0 -q filesrc "location=$source" ! neighbourcodeparse ! neighbourcodedec ! plyenc ! model/gltf-binary ! filesink "location=$work/scene.glb"
gst-launch-1.0 -q avatartestsrc views=1 num-buffers=1 "rig-export=$work/rig.yaml" ! video/x-range,width=160,height=120 ! fakesink
for angle in -30 100; do
  gst-launch-1.0 -q filesrc "location=$source" ! neighbourcodeparse ! neighbourcodedec ! striprender mode=blend fit=true "azimuth=$angle" \
    ! "video/x-raw,format=RGBA,width=640,height=480" ! videoconvert ! pngenc snapshot=true \
    ! filesink "location=$work/native-$angle.png" || skip "striprender cannot draw here"
done
live=("$here/live.test.js" "$here/speech.test.js")
compgen -G "$RANGECAST_BUILD/gst/web/*.so" >/dev/null || { echo "left out: live.test.js and speech.test.js, because rangewebsink is missing"; live=(); }
exec node --test "$@" "$here/embed.test.js" "$here/page.test.js" "$here/segments.test.js" "$here/server.test.js" "${live[@]}"
