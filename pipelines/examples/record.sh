#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# Records the stream at UDP port 7000 to a file, until Ctrl-C.
caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96
exec gst-launch-1.0 -e udpsrc port=7000 buffer-size=4194304 caps=$caps ! rtpneighbourcodeguard ! rtpjitterbuffer latency=50 \
  ! rtpneighbourcodedepay ! filesink location="${1:-person.rcnc}"
