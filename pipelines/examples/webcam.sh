#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# A USB stereo camera that packs both images side by side; webcam.yaml is its calibration, by `rangecast webcam`.
exec gst-launch-1.0 v4l2src device="${1:-/dev/video0}" ! image/jpeg,width=1280,height=480 ! jpegdec ! videoconvert \
  ! queue leaky=downstream max-size-buffers=2 ! depth.left stereodepth name=depth packing=side-by-side rig=webcam.yaml \
  ! striprender ! 'video/x-raw,width=640,height=480' ! videoconvert ! autovideosink
