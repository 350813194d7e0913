#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# Combines the views that arrive at UDP ports 5000 and 5001 by capture time and sends them to port 7000.
caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE,payload=96
exec gst-launch-1.0 rangemux name=mux latency=60000000 ! rtpneighbourcodepay ! udpsink host=127.0.0.1 port=7000 sync=false \
  udpsrc port=5000 buffer-size=4194304 caps=$caps ! rtpneighbourcodeguard ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux. \
  udpsrc port=5001 buffer-size=4194304 caps=$caps ! rtpneighbourcodeguard ! rtpjitterbuffer latency=30 ! rtpneighbourcodedepay ! mux.
