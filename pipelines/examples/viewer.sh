#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# Shows the stream at UDP port 7000 in a window; drag to orbit.
caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96
exec gst-launch-1.0 udpsrc port=7000 buffer-size=4194304 caps=$caps ! rtpneighbourcodeguard ! rtpjitterbuffer latency=30 \
  ! rtpneighbourcodedepay ! queue leaky=downstream max-size-buffers=4 ! neighbourcodedec ! rangealign \
  ! striprender ! 'video/x-raw,width=640,height=480' ! videoconvert ! autovideosink sync=false
