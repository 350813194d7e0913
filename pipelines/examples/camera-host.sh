#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# View 0 of a simulated rig of four, coded, to UDP port 5000. Make rig.yaml first (last line of this comment); with cameras of
# your own: stereocamsrc, and a rig file of `rangecast calibrate`.
# gst-launch-1.0 avatartestsrc views=4 num-buffers=1 rig-export=rig.yaml ! fakesink
exec gst-launch-1.0 avatartestsrc name=c is-live=true views=4 view-id=0 empty-frames=25 \
  c.left ! video/x-raw,width=320,height=240,framerate=15/1 ! queue ! depth.left \
  c.right ! video/x-raw,width=320,height=240,framerate=15/1 ! queue ! depth.right \
  stereodepth name=depth rig="${1:-rig.yaml}" view-id=0 ! roiextract background-frames=20 ! queue leaky=downstream \
  ! neighbourcodeenc ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=5000 sync=false
