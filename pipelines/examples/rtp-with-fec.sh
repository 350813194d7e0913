#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# The built-in figure through a network that loses packets: 25 % redundant ones restore them. One process, two ends.
caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96
exec gst-launch-1.0 avatartestsrc is-live=true range-person-only=true ! neighbourcodeenc ! rtpneighbourcodepay \
  ! rtpulpfecenc percentage=25 pt=122 ! identity drop-probability=0.03 ! udpsink host=127.0.0.1 port=7000 sync=false \
  udpsrc port=7000 buffer-size=4194304 caps=$caps ! rtpneighbourcodeguard ! rtpstorage size-time=500000000 \
  ! rtpjitterbuffer latency=100 do-lost=true ! rtpulpfecdec pt=122 ! rtpneighbourcodedepay ! neighbourcodedec ! rangealign \
  ! striprender ! 'video/x-raw,width=640,height=480' ! videoconvert ! autovideosink
