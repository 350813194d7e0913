/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The key of SRTP, from a file: on a command line everybody on the machine could read it. */
#pragma once

#include <gst/gst.h>

/** Gives the key in `path` (60 hexadecimal digits: 16 bytes of key, 14 of salt) to every srtpenc
 *  and srtpdec of a pipeline. Packets that do not open with it are said on stderr, once until one
 *  does.
 *  @return whether the file holds a key, and all have it; if not, that is said, too */
bool give_srtp_key (GstElement *pipeline, const char *path);
