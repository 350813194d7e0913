#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
# Plays a recording in a window, orbiting.
exec gst-launch-1.0 filesrc location="${1:-person.rcnc}" ! neighbourcodeparse ! neighbourcodedec ! rangealign \
  ! striprender fit=true auto-orbit=30 ! 'video/x-raw,width=640,height=480' ! videoconvert ! autovideosink
